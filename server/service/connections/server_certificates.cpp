#include "server/service/connections/server_certificates.h"

#include <absl/strings/str_cat.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <spdlog/spdlog.h>

#include <ctime>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/connections/openssl_objects.h"

namespace touchstone::service {
namespace {

constexpr uint64_t kMaxPemBytes = 4 << 20;

absl::StatusOr<Certificate> FirstCertificate(const std::string& text, const std::string& path) {
  Certificate certificate(PEM_read_bio_X509(BioOf(text).get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  if (certificate == nullptr)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": holds no certificate; PEM was expected, -----BEGIN CERTIFICATE-----"));
  return certificate;
}

absl::Status CheckPair(const CertificateTexts& texts, const std::array<std::string, 3>& paths) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Certificate certificate, FirstCertificate(texts.certificate, paths[0]));
  // An encrypted key would have OpenSSL ask at the terminal: its passphrase is empty instead.
  const auto no_passphrase = [](char*, int, int, void*) { return 0; };
  const Key key(PEM_read_bio_PrivateKey(BioOf(texts.key).get(), nullptr, no_passphrase, nullptr));
  ERR_clear_error();
  if (key == nullptr)
    return absl::InvalidArgumentError(
        absl::StrCat(paths[1], ": holds no private key; PEM without a passphrase was expected"));
  const bool fits = X509_check_private_key(certificate.get(), key.get()) == 1;
  ERR_clear_error();
  if (!fits)
    return absl::InvalidArgumentError(
        absl::StrCat(paths[1], " is not the private key of ", paths[0], ": both must come from one request"));
  if (!paths[2].empty()) TOUCHSTONE_RETURN_IF_ERROR(FirstCertificate(texts.client_ca, paths[2]).status());
  int days = 0, seconds = 0;
  if (ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(certificate.get())) == 1) {
    if (days < 0 || seconds < 0)
      spdlog::error("{} has expired: clients refuse it", paths[0]);
    else if (days < 14)
      spdlog::warn("{} expires in {} days", paths[0], days);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<ServerCertificates>> ServerCertificates::Read(const std::string& certificate,
                                                                             const std::string& key,
                                                                             const std::string& client_ca) {
  std::unique_ptr<ServerCertificates> certificates(new ServerCertificates({certificate, key, client_ca}));
  certificates->stamps_ = certificates->Stamps();
  TOUCHSTONE_RETURN_IF_ERROR(certificates->Load());
  return certificates;
}

std::array<FileStamp, 3> ServerCertificates::Stamps() const {
  std::array<FileStamp, 3> stamps;
  for (size_t i = 0; i < paths_.size(); ++i)
    if (!paths_[i].empty()) stamps[i] = FileStamp::Of(paths_[i]);
  return stamps;
}

absl::Status ServerCertificates::Load() {
  constexpr const char* kOptions[] = {"tls_cert", "tls_key", "tls_client_ca"};
  CertificateTexts texts;
  std::string* const parts[] = {&texts.certificate, &texts.key, &texts.client_ca};
  for (size_t i = 0; i < paths_.size(); ++i) {
    if (paths_[i].empty()) continue;
    absl::StatusOr<std::string> text = ReadFile(paths_[i], kMaxPemBytes);
    if (!text.ok())
      return absl::InvalidArgumentError(absl::StrCat(kOptions[i], ": ", text.status().message()));
    *parts[i] = *std::move(text);
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckPair(texts, paths_));
  texts_ = std::move(texts);
  taken_ = false;
  return absl::OkStatus();
}

std::optional<CertificateTexts> ServerCertificates::TakeIfNew() {
  const std::array<FileStamp, 3> stamps = Stamps();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stamps != stamps_) {
    stamps_ = stamps;
    const absl::Status loaded = Load();
    if (loaded.ok())
      spdlog::info("access: {} has changed: new connections get the new certificate", paths_[0]);
    else
      spdlog::error("access: {}; the former certificate stays in use", std::string(loaded.message()));
  }
  if (taken_) return std::nullopt;
  taken_ = true;
  return texts_;
}

}  // namespace touchstone::service
