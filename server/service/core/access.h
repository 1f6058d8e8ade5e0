// Who may call what: the one place that decides for every method of a process, before its request is even read.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/statusor.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_context.h>

#include "server/base/threads/clock.h"
#include "server/service/connections/file_stamp.h"
#include "server/service/connections/server_certificates.h"
#include "server/service/connections/sparse_warning.h"
#include "server/service/core/access_file.h"
#include "server/service/options/access_options.h"
#include "server/service/options/access_roles.h"

namespace touchstone::service {

class CallMetrics;

// What a caller showed.
struct ShownCredentials {
  std::vector<std::string> authorization;  // metadata of that name
  std::vector<std::string>
      certificate_names;  // subject and alternative names of a verified client certificate
};

// Safe for use by many threads. Outlives the server that it guards.
class Access {
 public:
  // Reads the files. Errors name the option, or the file and line.
  static absl::StatusOr<std::unique_ptr<Access>> Create(const std::string& listen,
                                                        const AccessOptions& options, Motion motion,
                                                        const Clock& clock = SteadyClock());
  ~Access();
  Access(const Access&) = delete;
  Access& operator=(const Access&) = delete;

  // Of the port: TLS or not, and this object's decision on every call.
  std::shared_ptr<grpc::ServerCredentials> Credentials();

  // UNAUTHENTICATED without credentials that are known here, PERMISSION_DENIED where the role is too low: naming method
  // and roles. `method` is the call's path.
  absl::Status Authorize(absl::string_view method, const ShownCredentials& shown);
  // Who makes a call that was let in; without a name where nobody is asked, as inside of this process.
  Caller CallerOf(const grpc::ServerContext& context);

  // For what a request asks beyond its method: PERMISSION_DENIED if its caller's role is below `needed`.
  absl::Status Require(const grpc::ServerContext& context, Role needed, const std::string& what);

  // Every refusal is counted there, too. To be called before a server starts.
  void CountRefusals(CallMetrics* calls) { calls_ = calls; }
  // Logs a refusal; a flood of them as one line a second.
  void LogRefusal(absl::string_view method, const absl::Status& why);

  bool asks() const { return options_.asks(); }
  ServerCertificates* certificates() { return certificates_.get(); }

 private:
  Access(AccessOptions options, Motion motion, const Clock& clock)
      : options_(std::move(options)), motion_(motion), clock_(clock) {}
  absl::StatusOr<Caller> Authenticate(const ShownCredentials& shown);
  std::shared_ptr<const AccessFile> File();  // as it is now
  void WarnEvery(const std::string& words);

  const AccessOptions options_;
  const Motion motion_;
  const Clock& clock_;
  std::unique_ptr<ServerCertificates> certificates_;

  std::mutex file_mutex_;
  FileStamp file_stamp_;
  std::shared_ptr<const AccessFile> file_;

  CallMetrics* calls_ = nullptr;
  SparseWarning refusals_{clock_};

  std::mutex warning_mutex_;
  std::condition_variable warning_ends_;
  bool ending_ = false;  // guarded by warning_mutex_
  std::thread warning_;
};

// "ana@bench2 (lab, operator)": what a caller says of itself, and who it was found to be.
std::string WithCaller(const std::string& said, const Caller& caller);

}  // namespace touchstone::service
