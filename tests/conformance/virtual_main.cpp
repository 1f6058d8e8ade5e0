// The conformance tests against the virtual source, or with --address HOST:PORT against any source.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>

#include "server/service/rpc/server.h"
#include "tests/conformance/conformance.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc == 3 && std::strcmp(argv[1], "--address") == 0) {
    touchstone::SetConformanceTarget(argv[2]);
    return RUN_ALL_TESTS();
  }
  touchstone::service::ServerOptions options;
  options.listen = "127.0.0.1:0";
  options.supershape_triangles = 2000;
  touchstone::ManualClock clock;
  options.clock = &clock;
  options.max_unary_calls_per_s = 0;  // it stands still while the tests call
  auto server = touchstone::service::Server::Start(options);
  if (!server.ok()) {
    std::fprintf(stderr, "%s\n", std::string(server.status().message()).c_str());
    return 1;
  }
  touchstone::SetConformanceTarget("127.0.0.1:" + std::to_string((*server)->port()), &clock);
  return RUN_ALL_TESTS();
}
