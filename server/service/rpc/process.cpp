#include "server/service/rpc/process.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <signal.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>

#include "server/base/process/stop_signals.h"
#include "server/base/text/printable.h"
#include "server/service/channel/self_probe.h"

namespace touchstone::service {
namespace {

// A log message in one line: what a client sent may stand in it, and must not look like a line of its own.
class OneLine : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& to) override {
    const std::string text =
        Printable(absl::string_view(message.payload.data(), message.payload.size()), kMaxLineBytes);
    to.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<spdlog::custom_flag_formatter> clone() const override {
    return std::make_unique<OneLine>();
  }

 private:
  static constexpr size_t kMaxLineBytes = 8192;
};

// A log message as a JSON string.
class JsonMessage : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& to) override {
    const std::string text =
        EscapeInJson(nlohmann::json(std::string(message.payload.data(), message.payload.size()))
                         .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    to.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<spdlog::custom_flag_formatter> clone() const override {
    return std::make_unique<JsonMessage>();
  }
};

constexpr double kGraceS = 10;

void EndAfter(double seconds) {
  std::thread([seconds] {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    std::_Exit(kExitUnreachable);
  }).detach();
}

}  // namespace

void SetUpLog(const std::string& level, bool json) {
  // Logs go to stderr; stdout carries the one line that scripts wait for.
  auto logger = spdlog::stderr_color_mt("touchstone");
  if (json) {
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<JsonMessage>('*').set_pattern(
        R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l","message":%*})");
    logger->set_formatter(std::move(formatter));
  } else {
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<OneLine>('*').set_pattern("%Y-%m-%d %H:%M:%S.%e %^%l%$ %*");
    logger->set_formatter(std::move(formatter));
  }
  spdlog::set_default_logger(logger);
  spdlog::set_level(spdlog::level::from_str(level));
}

void ForgetProxies() {
  for (const char* kind : {"http", "https", "ftp", "all", "grpc"}) {
    const std::string name = absl::StrCat(kind, "_proxy");
    ::unsetenv(name.c_str());
    ::unsetenv(absl::AsciiStrToUpper(name).c_str());
  }
}

void AnnounceListening(const std::string& listen, int port) {
  const std::string host = listen.substr(0, listen.rfind(':'));
  std::printf("listening on %s:%d\n", host.c_str(), port);
  std::fflush(stdout);
  spdlog::info("listening on {}:{}", host, port);
}

int ReportStartError(const char* program, const absl::Status& status) {
  std::fprintf(stderr, "%s: error: %s\n", program,
               Printable(status.message(), std::string::npos, /*keep_lines=*/true).c_str());
  return absl::IsUnavailable(status) ? 3 : 2;
}

bool ServeUntilSignal(const ServerOptions& options, int port, const char* what_begins) {
  AnnounceListening(options.listen, port);
  std::atomic<bool> unreachable{false};
  std::unique_ptr<SelfProbe> probe;
  if (options.self_probe_s > 0)
    probe = std::make_unique<SelfProbe>(OwnAddress(options.listen, port), !options.access.tls_cert.empty(),
                                        options.self_probe_s, options.self_probe_s, [&] {
                                          unreachable = true;
                                          EndAfter(options.drain_s + kGraceS);
                                          ::kill(::getpid(), SIGTERM);
                                        });
  const int signal = WaitForStopSignal();
  probe.reset();
  if (unreachable)
    spdlog::critical("nobody can reach this process any more: it ends with status {}, to be started anew",
                     kExitUnreachable);
  spdlog::info("signal {}: {} for up to {} s", signal, what_begins, options.drain_s);
  return unreachable;
}

void LogStopped() {
  spdlog::info("stopped");
}

}  // namespace touchstone::service
