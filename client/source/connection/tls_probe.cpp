#include "client/source/connection/tls_probe.h"

#include <absl/strings/str_cat.h>
#include <netdb.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>

namespace touchstone::client {
namespace {

constexpr timeval kPatience{2, 0};

template <auto Free>
struct Freed {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};

// A TCP connection; -1 if nobody answers.
int ConnectTcp(const std::string& host, const std::string& port) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (::getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) return -1;
  const std::unique_ptr<addrinfo, Freed<::freeaddrinfo>> addresses(found);
  for (const addrinfo* a = found; a != nullptr; a = a->ai_next) {
    const int fd = ::socket(a->ai_family, a->ai_socktype | SOCK_CLOEXEC, a->ai_protocol);
    if (fd < 0) continue;
    ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
    ::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
    if (::connect(fd, a->ai_addr, a->ai_addrlen) == 0) return fd;
    ::close(fd);
  }
  return -1;
}

// "localhost, 127.0.0.1".
std::string NamesIn(X509* certificate) {
  std::string names;
  auto* const list =
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr));
  const std::unique_ptr<GENERAL_NAMES, Freed<GENERAL_NAMES_free>> owner(list);
  for (int i = 0; i < sk_GENERAL_NAME_num(list); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(list, i);
    std::string text;
    if (name->type == GEN_DNS) {
      text.assign(reinterpret_cast<const char*>(ASN1_STRING_get0_data(name->d.dNSName)),
                  ASN1_STRING_length(name->d.dNSName));
    } else if (name->type == GEN_IPADD && ASN1_STRING_length(name->d.iPAddress) == 4) {
      const unsigned char* const b = ASN1_STRING_get0_data(name->d.iPAddress);
      text = absl::StrCat(b[0], ".", b[1], ".", b[2], ".", b[3]);
    }
    if (!text.empty()) absl::StrAppend(&names, names.empty() ? "" : ", ", text);
  }
  return names.empty() ? "no name" : names;
}

// Of the error that OpenSSL reported last: "wrong version number"; its number in `reason`.
std::string LastError(int* reason) {
  const unsigned long error = ERR_peek_last_error();
  *reason = ERR_GET_REASON(error);
  const char* const text = ERR_reason_error_string(error);
  ERR_clear_error();
  return text == nullptr ? "" : text;
}

// What is wrong with the certificate that the server showed.
std::string ExplainCertificate(SSL* ssl, const std::string& address, const std::string& host,
                               const std::string& ca) {
  const long result = SSL_get_verify_result(ssl);
  const std::unique_ptr<X509, Freed<X509_free>> certificate(SSL_get1_peer_certificate(ssl));
  if (result == X509_V_OK || certificate == nullptr) return "";
  const std::string whose = absl::StrCat("the certificate of ", address);
  if (result == X509_V_ERR_HOSTNAME_MISMATCH || result == X509_V_ERR_IP_ADDRESS_MISMATCH)
    return absl::StrCat(whose, " is for ", NamesIn(certificate.get()), ", not for '", host,
                        "': use a name that it has, or a certificate that has this one");
  if (result == X509_V_ERR_CERT_HAS_EXPIRED)
    return absl::StrCat(whose, " has expired: its server needs a new one");
  if (result == X509_V_ERR_CERT_NOT_YET_VALID)
    return absl::StrCat(whose, " is not valid yet: compare the clocks of both machines");
  return absl::StrCat(whose, " comes from no CA in --tls-ca ", ca, " (",
                      X509_verify_cert_error_string(result), "): give the CA that signed it");
}

std::string ExplainHandshake(SSL* ssl, const std::string& address, const std::string& host,
                             const Credentials& credentials) {
  int reason = 0;
  const bool shaken = SSL_connect(ssl) == 1;
  if (!credentials.tls()) {
    ERR_clear_error();
    return !shaken
               ? ""
               : absl::StrCat(address,
                              " speaks TLS: give the CA of its certificate with --tls-ca FILE, or --tls-ca "
                              "system");
  }
  if (!shaken) {
    const std::string why = LastError(&reason);
    if (reason == SSL_R_WRONG_VERSION_NUMBER || reason == SSL_R_HTTP_REQUEST ||
        reason == SSL_R_PACKET_LENGTH_TOO_LONG)
      return absl::StrCat(address,
                          " speaks plain text, not TLS: start it with --tls-cert and --tls-key, or leave out "
                          "--tls-ca");
    return why.empty() ? "" : absl::StrCat("no TLS with ", address, ": ", why);
  }
  std::string why = ExplainCertificate(ssl, address, host, credentials.tls_ca);
  if (!why.empty()) return why;
  // What a server has against a client's certificate shows after the handshake: gRPC's servers hang up.
  char byte = 0;
  const int got = SSL_read(ssl, &byte, 1);
  const bool silent = got < 0 && SSL_get_error(ssl, got) == SSL_ERROR_WANT_READ;  // until our patience ended
  ERR_clear_error();
  if (got == 1 || silent || credentials.tls_cert.empty()) return "";
  return absl::StrCat(address, " hangs up when it is shown the client certificate ", credentials.tls_cert,
                      ": it must come from a CA that the server was given with --tls-client-ca");
}

}  // namespace

std::string ExplainTlsFailure(const std::string& address, const Credentials& credentials) {
  const size_t colon = address.rfind(':');
  if (address.rfind("unix:", 0) == 0 || colon == std::string::npos) return "";
  std::string host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  const std::unique_ptr<SSL_CTX, Freed<SSL_CTX_free>> context(SSL_CTX_new(TLS_client_method()));
  if (credentials.tls_ca == "system")
    SSL_CTX_set_default_verify_paths(context.get());
  else if (credentials.tls())
    SSL_CTX_load_verify_file(context.get(), credentials.tls_ca.c_str());
  if (!credentials.tls_cert.empty()) {
    SSL_CTX_use_certificate_chain_file(context.get(), credentials.tls_cert.c_str());
    if (SSL_CTX_use_PrivateKey_file(context.get(), credentials.tls_key.c_str(), SSL_FILETYPE_PEM) != 1) {
      ERR_clear_error();
      return absl::StrCat("--tls-key ", credentials.tls_key, " is not the private key of --tls-cert ",
                          credentials.tls_cert);
    }
  }
  const std::unique_ptr<SSL, Freed<SSL_free>> ssl(SSL_new(context.get()));
  X509_VERIFY_PARAM* const verified = SSL_get0_param(ssl.get());
  if (X509_VERIFY_PARAM_set1_ip_asc(verified, host.c_str()) != 1)
    X509_VERIFY_PARAM_set1_host(verified, host.c_str(), 0);
  SSL_set_tlsext_host_name(ssl.get(), host.c_str());
  constexpr unsigned char kHttp2[] = {2, 'h', '2'};
  SSL_set_alpn_protos(ssl.get(), kHttp2, sizeof kHttp2);
  ERR_clear_error();
  const int fd = ConnectTcp(host, address.substr(colon + 1));
  if (fd < 0) return "";
  SSL_set_fd(ssl.get(), fd);
  const std::string why = ExplainHandshake(ssl.get(), address, host, credentials);
  ::close(fd);
  return why;
}

}  // namespace touchstone::client
