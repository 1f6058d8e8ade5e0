#include "server/service/host_port.h"

#include <gtest/gtest.h>

namespace touchstone::service {
namespace {

TEST(HostPort, IsReadInEveryForm) {
  for (const auto& [address, host, port] : {std::tuple{"127.0.0.1:50051", "127.0.0.1", 50051},
                                            {"localhost:0", "localhost", 0},
                                            {"[::1]:65535", "::1", 65535},
                                            {":9464", "", 9464},
                                            {"[::]:1", "::", 1}}) {
    const std::optional<HostPort> parsed = ParseHostPort(address);
    ASSERT_TRUE(parsed) << address;
    EXPECT_EQ(parsed->host, host);
    EXPECT_EQ(parsed->port, port);
  }
}

TEST(HostPort, OfNoPortIsRefused) {
  for (const char* address : {"", "localhost", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:99999",
                              "127.0.0.1:-1", "a:+1", "a: 1", "a:1 ", "a:http", "a:000001", "a:4294967297"})
    EXPECT_FALSE(ParseHostPort(address)) << address;
}

}  // namespace
}  // namespace touchstone::service
