#include "server/service/channel/channel.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>

namespace touchstone::service {
namespace {

// The variables of proxies as a test wants them, and afterwards none.
class ProxyForTest : public testing::Test {
 protected:
  ProxyForTest() { Clear(); }
  ~ProxyForTest() override { Clear(); }
  static void Clear() {
    for (const char* name : {"grpc_proxy", "https_proxy", "http_proxy", "no_grpc_proxy", "no_proxy"})
      ::unsetenv(name);
  }
  static void Set(const char* name, const char* value) { ::setenv(name, value, 1); }
};

TEST_F(ProxyForTest, IsNoneForThisMachine) {
  Set("http_proxy", "http://proxy:3128");
  for (const char* local : {"127.0.0.1:50051", "localhost:1", "[::1]:1", "unix:/run/t", "dns:///localhost:1"})
    EXPECT_EQ(ProxyFor(local), "") << local;
  char own[256] = "";
  ASSERT_EQ(::gethostname(own, sizeof own - 1), 0);
  EXPECT_EQ(ProxyFor(std::string(own) + ":50051"), "");
  EXPECT_EQ(ProxyFor("bench2:50051"), "the proxy http://proxy:3128 (http_proxy)");
  EXPECT_EQ(ProxyFor("dns:///bench2:50051"), "the proxy http://proxy:3128 (http_proxy)");
}

TEST_F(ProxyForTest, IsThatOfTheFirstVariableThatIsSet) {
  EXPECT_EQ(ProxyFor("bench2:1"), "");
  Set("http_proxy", "http://c");
  Set("https_proxy", "http://b");
  EXPECT_EQ(ProxyFor("bench2:1"), "the proxy http://b (https_proxy)");
  Set("grpc_proxy", "http://a");
  EXPECT_EQ(ProxyFor("bench2:1"), "the proxy http://a (grpc_proxy)");
  Set("grpc_proxy", "socks5://a");
  EXPECT_EQ(ProxyFor("bench2:1"), "") << "gRPC speaks to http:// proxies only";
  Set("grpc_proxy", "");
  EXPECT_EQ(ProxyFor("bench2:1"), "");
}

TEST_F(ProxyForTest, IsNoneForHostsThatNeedNone) {
  Set("http_proxy", "http://proxy:3128");
  Set("no_proxy", ".lab, bench2,10.0.0.7");
  for (const char* direct :
       {"a.lab:1", "bench2:1", "BENCH2:1", "10.0.0.7:1", "dns:///a.lab:1", "ipv4:10.0.0.7:1"})
    EXPECT_EQ(ProxyFor(direct), "") << direct;
  for (const char* far : {"a.lab.example:1", "bench3:1", "10.0.0.8:1"}) EXPECT_NE(ProxyFor(far), "") << far;
  Set("no_grpc_proxy", "bench3");
  EXPECT_EQ(ProxyFor("bench3:1"), "");
  EXPECT_NE(ProxyFor("bench2:1"), "");
}

TEST_F(ProxyForTest, IsNamedWithoutItsPassword) {
  for (const char* url : {"http://ana:secret@proxy:3128", "http://ana:se@cret@proxy:3128/path?secret",
                          "http://secret@proxy:3128/"}) {
    Set("http_proxy", url);
    EXPECT_EQ(ProxyFor("bench2:1"), "the proxy http://proxy:3128 (http_proxy)") << url;
  }
}

}  // namespace
}  // namespace touchstone::service
