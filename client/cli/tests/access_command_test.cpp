// touchstone token, and what the command line shows to a server and says when that is not enough.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "client/cli/tests/real_binary_test.h"
#include "server/service/core/access_file.h"
#include "server/service/rpc/server.h"
#include "server/service/tests/test_certificates.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class AccessCommandTest : public RealBinaryTest {
 protected:
  mode_t Mode(const std::string& name) {
    struct stat status {};
    ::stat(Path(name).c_str(), &status);
    return status.st_mode & 0777;
  }
};

TEST_F(AccessCommandTest, ATokenThatWasMadeOpensAServerAsFarAsItsRole) {
  ASSERT_EQ(
      Run({"token", "new", "ana", "--role", "reader", "--add-to", "tokens", "-o", "ana.token"}).exit_code, 0);
  const Outcome ben = Run({"token", "new", "ben", "--role", "admin", "--add-to", "tokens"});
  ASSERT_EQ(ben.exit_code, 0) << ben.err;
  Write("ben.token", ben.out);
  EXPECT_EQ(Mode("ana.token"), 0600u);
  EXPECT_EQ(Mode("tokens"), 0600u);
  EXPECT_THAT(Read("tokens"),
              AllOf(HasSubstr("ana reader sha256:"), HasSubstr("ben admin sha256:"),
                    Not(HasSubstr(Read("ana.token").substr(3, 20))), Not(HasSubstr(ben.out.substr(3, 20)))));
  const service::TestCertificates certificates;
  certificates.Issue("server", "DNS:localhost");
  service::ServerOptions options;
  options.listen = "0.0.0.0:0";
  options.supershape_triangles = 500;
  options.access.tls_cert = certificates.Path("server.pem");
  options.access.tls_key = certificates.Path("server.key");
  options.access.token_file = Path("tokens");
  const auto server = service::Server::Start(options);
  ASSERT_TRUE(server.ok()) << server.status();
  const std::string address = "localhost:" + std::to_string((*server)->port());
  const std::vector<std::string> to = {"--server", address, "--tls-ca", certificates.Path("ca.pem")};
  const auto with = [&](std::vector<std::string> words, const std::string& token) {
    words.insert(words.end(), to.begin(), to.end());
    if (!token.empty()) words.insert(words.end(), {"--token-file", token});
    return Run(words);
  };
  EXPECT_EQ(with({"objects"}, "ana.token").exit_code, 0);
  const Outcome stranger = with({"objects"}, "");
  EXPECT_EQ(stranger.exit_code, 4);
  EXPECT_THAT(stranger.err, AllOf(HasSubstr("asks who calls"), HasSubstr("--token-file")));
  Write("model.yaml", "touchstone: model/1\nname: mine\neffects: []\n");
  const Outcome reader = with({"session", "delete", "none"}, "ana.token");
  EXPECT_EQ(reader.exit_code, 4);
  EXPECT_THAT(reader.err,
              HasSubstr("Sessions.DeleteSession needs the role admin; 'ana' has the role reader"));
  EXPECT_EQ(with({"session", "delete", "none"}, "ben.token").exit_code, 2);  // there is none of that name
  const Outcome plain = Run({"objects", "--server", address});
  EXPECT_EQ(plain.exit_code, 2);
  EXPECT_THAT(plain.err, HasSubstr("speaks TLS"));
}

TEST_F(AccessCommandTest, MistakesAreSaidAndNothingIsWrittenOver) {
  EXPECT_THAT(Run({"token", "new", "ana", "--role", "king"}).err, HasSubstr("is no role"));
  EXPECT_THAT(Run({"token", "new", "a na", "--role", "reader"}).err, HasSubstr("letters, digits"));
  EXPECT_THAT(Run({"objects", "--tls-ca", "ca.pem"}).err, HasSubstr("works only with --server"));
  Write("tokens", "no token file\n");
  EXPECT_THAT(Run({"token", "new", "ana", "--role", "reader", "--add-to", "tokens"}).err,
              HasSubstr("tokens:1"));
  EXPECT_EQ(Read("tokens"), "no token file\n");
  Write("ana.token", "kept");
  EXPECT_EQ(Run({"token", "new", "ana", "--role", "reader", "-o", "ana.token"}).exit_code, 2);
  EXPECT_EQ(Read("ana.token"), "kept");
}

}  // namespace
}  // namespace touchstone::cli
