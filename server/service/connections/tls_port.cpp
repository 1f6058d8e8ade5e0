#include "server/service/connections/tls_port.h"

#include <absl/strings/str_cat.h>
#include <arpa/inet.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "server/base/status.h"
#include "server/service/connections/openssl_objects.h"

namespace touchstone::service {
namespace {

constexpr unsigned char kHttp2[] = {2, 'h', '2'};
// Of TLS 1.2: forward secrecy and authenticated encryption alone, as gRPC has it.
constexpr char kCiphers[] =
    "ECDHE-ECDSA-AES128-GCM-SHA256:ECDHE-ECDSA-AES256-GCM-SHA384:ECDHE-RSA-AES128-GCM-SHA256:"
    "ECDHE-RSA-AES256-GCM-SHA384";
constexpr unsigned char kSessions[] = "touchstone";

absl::Status Failed(const char* what) {
  char words[256];
  ERR_error_string_n(ERR_get_error(), words, sizeof words);
  ERR_clear_error();
  return absl::InvalidArgumentError(absl::StrCat(what, ": ", words));
}

std::vector<Certificate> CertificatesOf(const std::string& pem) {
  std::vector<Certificate> certificates;
  const Bio bio = BioOf(pem);
  while (X509* const next = PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr))
    certificates.emplace_back(next);
  ERR_clear_error();  // what follows the last one is none
  return certificates;
}

int SelectHttp2(SSL*, const unsigned char** out, unsigned char* out_size, const unsigned char* in,
                unsigned in_size, void*) {
  unsigned char* chosen = nullptr;
  if (SSL_select_next_proto(&chosen, out_size, kHttp2, sizeof kHttp2, in, in_size) != OPENSSL_NPN_NEGOTIATED)
    return SSL_TLSEXT_ERR_ALERT_FATAL;
  *out = chosen;
  return SSL_TLSEXT_ERR_OK;
}

std::string TextOf(const ASN1_STRING* string) {
  unsigned char* bytes = nullptr;
  const int size = ASN1_STRING_to_UTF8(&bytes, string);
  std::string text(reinterpret_cast<const char*>(bytes), std::max(size, 0));
  OPENSSL_free(bytes);
  return text;
}

std::string IpAddressOf(const ASN1_OCTET_STRING* address) {
  char text[INET6_ADDRSTRLEN] = "";
  const int size = ASN1_STRING_length(address);
  ::inet_ntop(size == 4 ? AF_INET : AF_INET6, ASN1_STRING_get0_data(address), text, sizeof text);
  return size == 4 || size == 16 ? text : "";
}

// Its common name, then its alternative names.
std::vector<std::string> NamesOf(X509* certificate) {
  std::vector<std::string> names;
  X509_NAME* const subject = X509_get_subject_name(certificate);
  if (const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1); at >= 0)
    names.push_back(TextOf(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at))));
  auto* const others =
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr));
  for (int k = 0; k < sk_GENERAL_NAME_num(others); ++k) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(others, k);
    if (name->type == GEN_DNS || name->type == GEN_EMAIL || name->type == GEN_URI)
      names.push_back(TextOf(name->d.ia5));
    else if (name->type == GEN_IPADD)
      names.push_back(IpAddressOf(name->d.iPAddress));
  }
  GENERAL_NAMES_free(others);
  return names;
}

class Tls final : public Wire {
 public:
  Tls(std::shared_ptr<SSL_CTX> context, int file)
      : context_(std::move(context)), ssl_(SSL_new(context_.get())) {
    SSL_set_fd(ssl_.get(), file);
    SSL_set_accept_state(ssl_.get());
  }

  Moved Read(char* to, size_t size) override {
    const int bytes = SSL_read(ssl_.get(), to, IntOf(size));
    reads_when_writable_ = bytes <= 0 && SSL_get_error(ssl_.get(), bytes) == SSL_ERROR_WANT_WRITE;
    return MovedBy(bytes);
  }
  Moved Write(absl::string_view bytes) override {
    return MovedBy(SSL_write(ssl_.get(), bytes.data(), IntOf(bytes.size())));
  }
  bool buffered() const override { return SSL_pending(ssl_.get()) > 0; }
  bool reads_when_writable() const override { return reads_when_writable_; }
  std::vector<std::string> CertificateNames() const override {
    const Certificate certificate(SSL_get1_peer_certificate(ssl_.get()));
    return certificate == nullptr ? std::vector<std::string>() : NamesOf(certificate.get());
  }

 private:
  static int IntOf(size_t size) {
    return static_cast<int>(std::min<size_t>(size, std::numeric_limits<int>::max()));
  }
  Moved MovedBy(int bytes) const {
    if (bytes > 0) return {State::kMoved, static_cast<size_t>(bytes)};
    const int error = SSL_get_error(ssl_.get(), bytes);
    ERR_clear_error();
    const bool later = error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE;
    return {later ? State::kBlocked : State::kEnded, 0};
  }

  const std::shared_ptr<SSL_CTX> context_;
  const std::unique_ptr<SSL, Freed<SSL_free>> ssl_;
  bool reads_when_writable_ = false;
};

}  // namespace

absl::Status TlsPort::Renew(const CertificateTexts& texts) {
  const std::shared_ptr<SSL_CTX> context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  SSL_CTX* const raw = context.get();
  SSL_CTX_set_min_proto_version(raw, TLS1_2_VERSION);
  SSL_CTX_set_cipher_list(raw, kCiphers);
  SSL_CTX_set_options(raw, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(
      raw, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_session_id_context(raw, kSessions, sizeof kSessions - 1);
  SSL_CTX_set_alpn_select_cb(raw, SelectHttp2, nullptr);
  std::vector<Certificate> chain = CertificatesOf(texts.certificate);
  const Bio key_text = BioOf(texts.key);
  const Key key(PEM_read_bio_PrivateKey(key_text.get(), nullptr, nullptr, nullptr));
  if (chain.empty() || SSL_CTX_use_certificate(raw, chain[0].get()) != 1) return Failed("tls_cert");
  for (size_t k = 1; k < chain.size(); ++k)
    if (SSL_CTX_add1_chain_cert(raw, chain[k].get()) != 1) return Failed("tls_cert");
  if (key == nullptr || SSL_CTX_use_PrivateKey(raw, key.get()) != 1) return Failed("tls_key");
  if (!texts.client_ca.empty()) {
    for (const Certificate& ca : CertificatesOf(texts.client_ca)) {
      if (X509_STORE_add_cert(SSL_CTX_get_cert_store(raw), ca.get()) != 1 ||
          SSL_CTX_add_client_CA(raw, ca.get()) != 1)
        return Failed("tls_client_ca");
    }
    SSL_CTX_set_verify(raw, SSL_VERIFY_PEER, nullptr);
  }
  context_ = context;
  return absl::OkStatus();
}

std::unique_ptr<Wire> TlsPort::Accept(int file) {
  if (const std::optional<CertificateTexts> texts = certificates_->TakeIfNew(); texts.has_value())
    if (const absl::Status renewed = Renew(*texts); !renewed.ok())
      spdlog::error("access: {}; the former certificate stays in use", std::string(renewed.message()));
  return context_ == nullptr ? nullptr : std::make_unique<Tls>(context_, file);
}

}  // namespace touchstone::service
