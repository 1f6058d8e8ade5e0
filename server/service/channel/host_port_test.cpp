#include "server/service/channel/host_port.h"

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

// client/python/tests/test_proxy.py has the same list.
TEST(LocalAddress, IsOneThatThisMachineAloneReaches) {
  for (const char* local : {"127.0.0.1:1", "127.1.2.3:1", "localhost:0", "LocalHost:1", "[::1]:1",
                            "[::ffff:127.0.0.1]:1", "unix:/run/t", "unix-abstract:t", "dns:localhost:1",
                            "dns:///127.0.0.1:1", "ipv4:127.0.0.1:1,127.0.0.2:1", "ipv6:[::1]:1", ""})
    EXPECT_TRUE(IsLocalAddress(local)) << local;
  for (const char* open :
       {"0.0.0.0:1", "[::]:1", "192.168.0.2:1", "bench2:1", "127.evil.example:1", "127.0.0.1.5:1", ":1",
        "localhost.x:1", "dns://10.0.0.1/localhost:1", "ipv4:127.0.0.1:1,10.0.0.1:1", "[::ffff:10.0.0.1]:1",
        "passthrough:127.0.0.1:1", "127.0.0.1"})
    EXPECT_FALSE(IsLocalAddress(open)) << open;
}

}  // namespace
}  // namespace touchstone::service
