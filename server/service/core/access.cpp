#include "server/service/core/access.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <grpc/grpc_security_constants.h>
#include <spdlog/spdlog.h>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/service/connections/certificate_stamp.h"
#include "server/service/core/access_credentials.h"
#include "server/service/core/metrics.h"

namespace touchstone::service {
namespace {

constexpr double kWarnEveryS = 60;  // of what `insecure` lets in
constexpr uint64_t kMaxFileBytes = 1 << 20;
constexpr size_t kMaxCertificateNameBytes = 64;
constexpr char kBearer[] = "Bearer ";

absl::StatusOr<std::shared_ptr<const AccessFile>> ReadAccessFile(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, kMaxFileBytes));
  TOUCHSTONE_ASSIGN_OR_RETURN(AccessFile file, AccessFile::Parse(text, path));
  if (file.tokens() + file.certificates() == 0)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": nobody may call: touchstone token new NAME --role reader --add-to ", path,
                     " adds somebody"));
  return std::make_shared<const AccessFile>(std::move(file));
}

absl::Status CheckRole(const Caller& caller, Role needed, const std::string& what) {
  if (caller.role >= needed) return absl::OkStatus();
  return absl::PermissionDeniedError(absl::StrCat(what, " needs the role ", RoleName(needed), "; '",
                                                  caller.name, "' has the role ", RoleName(caller.role)));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Access>> Access::Create(const std::string& listen,
                                                       const AccessOptions& options, Motion motion,
                                                       const Clock& clock) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckAccess(listen, options));
  std::unique_ptr<Access> access(new Access(options, motion, clock));
  if (options.tls()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        access->certificates_,
        ServerCertificates::Read(options.tls_cert, options.tls_key, options.tls_client_ca));
  }
  if (!options.token_file.empty()) {
    access->file_stamp_ = FileStamp::Of(options.token_file);
    absl::StatusOr<std::shared_ptr<const AccessFile>> file = ReadAccessFile(options.token_file);
    if (!file.ok()) return absl::InvalidArgumentError(absl::StrCat("token_file: ", file.status().message()));
    access->file_ = *std::move(file);
    spdlog::info("access: {} tokens and {} certificates may call ({})", access->file_->tokens(),
                 access->file_->certificates(), options.token_file);
  }
  if (const std::string words = InsecureWords(listen, options); !words.empty())
    access->warning_ = std::thread([raw = access.get(), words] { raw->WarnEvery(words); });
  return access;
}

Access::~Access() {
  {
    const std::lock_guard<std::mutex> lock(warning_mutex_);
    ending_ = true;
  }
  warning_ends_.notify_all();
  if (warning_.joinable()) warning_.join();
}

void Access::WarnEvery(const std::string& words) {
  std::unique_lock<std::mutex> lock(warning_mutex_);
  while (!ending_) {
    spdlog::warn("{}", words);
    clock_.WaitFor(lock, warning_ends_, kWarnEveryS, [this] { return ending_; });
  }
}

std::shared_ptr<grpc::ServerCredentials> Access::Credentials() {
  return std::make_shared<AccessCredentials>(this);
}

std::shared_ptr<const AccessFile> Access::File() {
  if (options_.token_file.empty()) return nullptr;
  const FileStamp stamp = FileStamp::Of(options_.token_file);
  const std::lock_guard<std::mutex> lock(file_mutex_);
  if (stamp == file_stamp_) return file_;
  file_stamp_ = stamp;
  absl::StatusOr<std::shared_ptr<const AccessFile>> file = ReadAccessFile(options_.token_file);
  if (file.ok()) {
    file_ = *std::move(file);
    spdlog::info("access: {} has changed: {} tokens and {} certificates may call", options_.token_file,
                 file_->tokens(), file_->certificates());
  } else {
    spdlog::error("access: token_file: {}; what it said before stays in force",
                  std::string(file.status().message()));
  }
  return file_;
}

absl::StatusOr<Caller> Access::Authenticate(const ShownCredentials& shown) {
  const std::shared_ptr<const AccessFile> file = File();
  if (!shown.authorization.empty()) {
    absl::string_view token = shown.authorization[0];
    if (shown.authorization.size() > 1 || !absl::StartsWithIgnoreCase(token, kBearer))
      return absl::UnauthenticatedError(
          "the metadata 'authorization' must stand there once, as 'Bearer TOKEN'");
    token.remove_prefix(sizeof kBearer - 1);
    const std::optional<Caller> caller = file == nullptr ? std::nullopt : file->FindToken(token);
    if (caller.has_value()) return *caller;
    return absl::UnauthenticatedError(
        file == nullptr
            ? "this source takes client certificates, not tokens: leave the token out"
            : "this token is not known here: it may be mistyped or replaced; whoever runs the source makes a "
              "new one with touchstone token new");
  }
  if (!shown.certificate_names.empty()) {
    if (const std::optional<Caller> caller =
            file == nullptr ? std::nullopt : file->FindCertificate(shown.certificate_names);
        caller.has_value())
      return *caller;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Role role, ParseRole(options_.client_cert_role));
    // Its CA vouches for who it is, not for what it does to a log.
    return Caller{Printable(shown.certificate_names[0], kMaxCertificateNameBytes), role};
  }
  return absl::UnauthenticatedError(absl::StrCat(
      "this source asks who calls: give ",
      file == nullptr ? "" : "a token (--token-file, TOUCHSTONE_TOKEN or touchstone.connect(token=...))",
      file == nullptr || options_.tls_client_ca.empty() ? "" : " or ",
      options_.tls_client_ca.empty() ? "" : "a client certificate (--tls-cert and --tls-key)"));
}

absl::Status Access::Authorize(absl::string_view method, const ShownCredentials& shown) {
  if (!asks()) return absl::OkStatus();
  // What has no role is no method of ours; gRPC says that it is not there, to whom it knows.
  const Role needed = RoleNeeded(method, motion_).value_or(Role::kReader);
  if (needed == Role::kNobody) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const Caller caller, Authenticate(shown));
  return CheckRole(caller, needed, MethodName(method));
}

Caller Access::CallerOf(const grpc::ServerContext& context) {
  if (!asks()) return {};
  ShownCredentials shown;
  const auto [begin, end] = context.client_metadata().equal_range("authorization");
  for (auto entry = begin; entry != end; ++entry)
    shown.authorization.emplace_back(entry->second.data(), entry->second.size());
  if (const auto stamp = context.client_metadata().find(StampName());
      stamp != context.client_metadata().end())
    shown.certificate_names = NamesOfStamp({stamp->second.data(), stamp->second.size()});
  for (const char* property : {GRPC_X509_CN_PROPERTY_NAME, GRPC_X509_SAN_PROPERTY_NAME})
    for (const grpc::string_ref& name : context.auth_context()->FindPropertyValues(property))
      shown.certificate_names.emplace_back(name.data(), name.size());
  // Its credentials may have been taken from it since it was let in.
  return Authenticate(shown).value_or(Caller{"", Role::kNobody});
}

absl::Status Access::Require(const grpc::ServerContext& context, Role needed, const std::string& what) {
  return CheckRole(CallerOf(context), needed, what);
}

void Access::LogRefusal(absl::string_view method, const absl::Status& why) {
  if (calls_ != nullptr) calls_->Refused(method, static_cast<int>(why.code()));
  refusals_.Say(absl::StrCat("refused ", MethodName(method), ": ", why.message()));
}

std::string WithCaller(const std::string& said, const Caller& caller) {
  if (caller.name.empty()) return said;
  const std::string found = absl::StrCat(" (", caller.name, ", ", RoleName(caller.role), ")");
  return absl::EndsWith(said, found) ? said : said + found;
}

}  // namespace touchstone::service
