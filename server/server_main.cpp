// touchstone-server: the virtual source as a process. Options come from flags and a TOML file; flags win.
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "server/service/server.h"
#include "server/service/server_flags.h"

namespace {

// A log message as a JSON string.
class JsonMessage : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& to) override {
    const std::string text = nlohmann::json(std::string(message.payload.data(), message.payload.size()))
                                 .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    to.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<spdlog::custom_flag_formatter> clone() const override {
    return std::make_unique<JsonMessage>();
  }
};

}  // namespace

int main(int argc, char** argv) {
  using namespace touchstone;
  auto flags = ParseServerFlags(argc, argv);
  if (!flags.ok()) {
    std::fprintf(stderr, "touchstone-server: error: %s\n", std::string(flags.status().message()).c_str());
    return 2;
  }
  if (flags->done) return 0;

  // Logs go to stderr; stdout carries the one line that scripts wait for.
  auto logger = spdlog::stderr_color_mt("touchstone");
  if (flags->log_json) {
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<JsonMessage>('*').set_pattern(
        R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l","message":%*})");
    logger->set_formatter(std::move(formatter));
  } else {
    logger->set_pattern("%Y-%m-%d %H:%M:%S.%e %^%l%$ %v");
  }
  spdlog::set_default_logger(logger);
  spdlog::set_level(spdlog::level::from_str(flags->log_level));

  // Signals are taken by this thread alone, with sigwait, so that nothing happens inside a handler.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  auto server = Server::Start(flags->options);
  if (!server.ok()) {
    std::fprintf(stderr, "touchstone-server: error: %s\n", std::string(server.status().message()).c_str());
    return server.status().code() == absl::StatusCode::kUnavailable ? 3 : 2;
  }
  const std::string host = flags->options.listen.substr(0, flags->options.listen.rfind(':'));
  std::printf("listening on %s:%d\n", host.c_str(), (*server)->port());
  std::fflush(stdout);
  spdlog::info("listening on {}:{}", host, (*server)->port());

  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("signal {}: draining for up to {} s", signal, flags->options.drain_s);
  (*server)->Drain();
  spdlog::info("stopped");
  return 0;
}
