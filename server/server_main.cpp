// touchstone-server: the virtual source as a process. Options come from flags and a TOML file; flags win.
#include <csignal>
#include <cstdio>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "server/service/server.h"
#include "server/service/server_flags.h"

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
  logger->set_pattern(flags->log_json ? R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l","message":"%v"})"
                                      : "%Y-%m-%d %H:%M:%S.%e %^%l%$ %v");
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
