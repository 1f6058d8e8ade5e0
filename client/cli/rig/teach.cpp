// touchstone rig teach: a plan's poses, shown by hand.
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <thread>

#include "client/cli/rig/rig.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "touchstone/v1/freedrive.grpc.pb.h"

namespace touchstone::cli {
namespace {

constexpr int kLookMs = 50;
constexpr double kStillMS = 5e-3;  // faster than that the hand still moves it

struct TeachOptions {
  MotionFlags motion;
  std::string output;
  double standoff_mm = 60, speed_mm_s = 20;
};

// The stream of a guided arm, read by a thread of its own. While it lives the arm is free; its end ends that.
class GuidedArm {
 public:
  GuidedArm(client::Connection* connection, const std::string& lease_token)
      : stub_(v1::Freedrive::NewStub(connection->channel())) {
    v1::GuideRequest request;
    request.set_lease_token(lease_token);
    stream_ = stub_->Guide(&context_, request);
    reader_ = std::thread([this] {
      v1::GuideState state;
      while (stream_->Read(&state)) {
        std::lock_guard<std::mutex> lock(mutex_);
        newest_ = state;
        free_ = true;
      }
      const grpc::Status status = stream_->Finish();
      std::lock_guard<std::mutex> lock(mutex_);
      status_ = client::FromGrpc(status);
      ended_ = true;
    });
  }
  ~GuidedArm() { End(); }
  void End() {
    context_.TryCancel();
    if (reader_.joinable()) reader_.join();
  }
  bool Free() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return free_;
  }
  v1::GuideState Newest() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return newest_;
  }
  // Why it ended; none while it lasts.
  std::optional<absl::Status> Ended() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return ended_ ? std::optional<absl::Status>(status_) : std::nullopt;
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<v1::Freedrive::Stub> stub_;
  std::unique_ptr<grpc::ClientReader<v1::GuideState>> stream_;
  std::thread reader_;
  mutable std::mutex mutex_;
  v1::GuideState newest_;
  bool free_ = false, ended_ = false;
  absl::Status status_;
};

// What a person types, without waiting longer than kLookMs: a line without its end; none yet. "q" at the end of stdin.
std::optional<std::string> TypedLine(std::string* begun) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (::poll(&input, 1, kLookMs) <= 0) return std::nullopt;
  char c = 0;
  if (::read(STDIN_FILENO, &c, 1) <= 0) return "q";
  if (c != '\n') {
    begun->push_back(c);
    return std::nullopt;
  }
  return std::exchange(*begun, "");
}

// A line of a person: Enter keeps the pose, u takes back. False: the end.
bool Obey(const std::string& line, const TeachOptions& options, const v1::GuideState& now,
          std::vector<client::MeasuredTouch>* taught) {
  if (line == "q") return false;
  if (line == "u") {
    if (!taught->empty()) taught->pop_back();
    std::fprintf(stderr, "%zu kept\n", taught->size());
    return true;
  }
  if (now.tip_speed_m_s() > kStillMS) {
    std::fprintf(stderr, "not kept: the tip moves at %.0f mm/s; hold it still\n",
                 now.tip_speed_m_s() / kMetresPerMillimetre);
    return true;
  }
  const absl::StatusOr<client::MeasuredTouch> touch =
      client::TaughtTouch(now, taught->size(), options.standoff_mm * kMetresPerMillimetre,
                          options.speed_mm_s * kMetresPerMillimetre);
  if (!touch.ok()) {
    std::fprintf(stderr, "not kept: %s\n", std::string(touch.status().message()).c_str());
    return true;
  }
  taught->push_back(*touch);
  const v1::Vector3& at = touch->commanded.target_m();
  std::fprintf(stderr, "touch %zu: (%.1f, %.1f, %.1f) mm in the frame of %s\n", taught->size() - 1,
               at.x() / kMetresPerMillimetre, at.y() / kMetresPerMillimetre, at.z() / kMetresPerMillimetre,
               touch->object.c_str());
  return true;
}

absl::Status RunTeach(const Cli& cli, const TeachOptions& options) {
  if (!(options.standoff_mm >= 1) || !(options.speed_mm_s > 0))
    return absl::InvalidArgumentError("--standoff-mm must be at least 1 and --speed-mm-s above 0");
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
  if (state.object().empty())
    return absl::FailedPreconditionError(
        "what lies on the fixture is unknown, and with it the frame of the poses: say it with 'touchstone "
        "rig mount'");
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, rig.connection.get(), options.motion));
  std::vector<client::MeasuredTouch> taught;
  absl::Status ended;
  {
    GuidedArm arm(rig.connection.get(), source->lease() != nullptr ? source->lease()->token() : "");
    bool told = false;
    for (std::string begun;;) {
      if (Interrupt::Raised()) break;
      if (const std::optional<absl::Status> over = arm.Ended(); over.has_value()) {
        ended = over->ok() ? absl::UnavailableError("the rig ended it") : *over;
        break;
      }
      if (!arm.Free()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
        continue;
      }
      if (!told)
        std::fprintf(
            stderr,
            "The arm is free: hold it. Put the middle finger where it is to touch, the tool along the "
            "approach.\nEnter keeps the pose, u takes the last one back, q ends.\n");
      told = true;
      const std::optional<std::string> line = TypedLine(&begun);
      if (line.has_value() && !Obey(*line, options, arm.Newest(), &taught)) break;
    }
  }
  // What was taught is not lost with the connection.
  if (!taught.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, client::FormatMeasurements(taught)));
    cli.LogWritten(options.output);
  }
  TOUCHSTONE_RETURN_IF_ERROR(ended);
  if (cli.output().json) PrintJson({{"touches", taught.size()}});
  cli.Log(absl::StrCat(
      "the arm holds still again; ", Counted(taught.size(), "touch was", "touches were"), " taught",
      taught.empty() ? "; nothing was written" : ". Try them: touchstone rig dry-run " + options.output));
  return absl::OkStatus();
}

}  // namespace

void AddRigTeach(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<TeachOptions>();
  CLI::App* command = cli->AddCommand(group, "teach",
                                      "Frees the arm (freedrive) and keeps the poses that a hand puts it in "
                                      "as a plan. Somebody must hold the arm.",
                                      "touchstone rig teach -o plan.csv --server 127.0.0.1:50052",
                                      [cli, options] { return RunTeach(*cli, *options); });
  cli->AddOutput(command, "-o,--output", &options->output, "The plan (CSV)")->required();
  command->add_option("--standoff-mm", options->standoff_mm, "Of every touch. Default: 60")->type_name("MM");
  command->add_option("--speed-mm-s", options->speed_mm_s, "Of every approach. Default: 20")
      ->type_name("MM/S");
  AddMotionOptions(command, &options->motion, false);
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
