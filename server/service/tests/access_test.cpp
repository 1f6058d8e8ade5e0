// What the parts of access decide; access_server_test.cpp asks a real server.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <set>

#include "server/service/core/access.h"
#include "server/service/rpc/server_flags.h"
#include "touchstone/v1/freedrive.pb.h"
#include "touchstone/v1/rig.pb.h"

namespace touchstone::service {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string Message(const absl::Status& status) {
  return std::string(status.message());
}

TEST(MethodRoles, EveryMethodOfTheProtocolHasARoleAndNoOther) {
  const auto* pool = google::protobuf::DescriptorPool::generated_pool();
  // Links what this library does not serve itself.
  v1::GetRigRequest::descriptor(), v1::GuideRequest::descriptor();
  std::set<std::string> described, listed;
  for (const char* file : {"source", "control", "models", "sessions", "diagnosis", "rig", "freedrive"}) {
    const auto* of_file = pool->FindFileByName("touchstone/v1/" + std::string(file) + ".proto");
    ASSERT_NE(of_file, nullptr) << file;
    for (int s = 0; s < of_file->service_count(); ++s)
      for (int m = 0; m < of_file->service(s)->method_count(); ++m)
        described.insert("/" + of_file->service(s)->full_name() + "/" +
                         of_file->service(s)->method(m)->name());
  }
  for (const MethodRole& row : MethodRoles()) {
    if (std::string(row.method).rfind("/touchstone.", 0) != 0) continue;
    EXPECT_TRUE(listed.insert(row.method).second) << row.method << " stands there twice";
  }
  EXPECT_EQ(listed, described);
}

TEST(MethodRoles, AServiceWithAMethodWithoutARoleIsNamed) {
  EXPECT_TRUE(CheckRolesOf("touchstone.v1.Source").ok());
  EXPECT_THAT(Message(CheckRolesOf("google.protobuf.Nothing")), HasSubstr("not described"));
}

TEST(MethodRoles, WhatMovesARigTakesAnOperatorThereAlone) {
  for (const char* method : {"Touch", "Capture", "StreamDataset"}) {
    const std::string path = "/touchstone.v1.Source/" + std::string(method);
    EXPECT_EQ(RoleNeeded(path, Motion::kRig), Role::kOperator) << path;
    EXPECT_EQ(RoleNeeded(path, Motion::kSimulated), Role::kReader) << path;
  }
  EXPECT_EQ(RoleNeeded("/touchstone.v1.Control/Stop", Motion::kRig), Role::kReader);
}

TEST(CheckAccess, SaysWhatIsMissingWhereOthersReachTheAddress) {
  AccessOptions options;
  EXPECT_TRUE(CheckAccess("127.0.0.1:1", options).ok());
  EXPECT_THAT(Message(CheckAccess("0.0.0.0:1", options)),
              AllOf(HasSubstr("0.0.0.0:1"), HasSubstr("--tls-cert"), HasSubstr("--token-file"),
                    HasSubstr("--insecure")));
  options.token_file = "tokens";
  EXPECT_THAT(Message(CheckAccess("0.0.0.0:1", options)),
              AllOf(HasSubstr("--tls-cert"), Not(HasSubstr("--token-file or"))));
  options.tls_cert = "a.pem";
  EXPECT_THAT(Message(CheckAccess("0.0.0.0:1", options)), HasSubstr("private key"));
  options.tls_key = "a.key";
  EXPECT_TRUE(CheckAccess("0.0.0.0:1", options).ok());
  EXPECT_EQ(InsecureWords("0.0.0.0:1", options), "");
  options.token_file.clear();
  EXPECT_THAT(Message(CheckAccess("0.0.0.0:1", options)),
              AllOf(Not(HasSubstr("needs TLS")), HasSubstr("--token-file")));
  options.insecure = true;
  EXPECT_TRUE(CheckAccess("0.0.0.0:1", options).ok());
  EXPECT_THAT(InsecureWords("0.0.0.0:1", options), HasSubstr("every right"));
  options.client_cert_role = "king";
  EXPECT_THAT(Message(CheckAccess("127.0.0.1:1", options)), HasSubstr("client_cert_role"));
}

TEST(AccessFile, FindsWhoHasATokenOrACertificate) {
  const std::string token = NewAccessToken(), other = NewAccessToken();
  EXPECT_EQ(token.size(), 46u);
  EXPECT_NE(token, other);
  const auto file = AccessFile::Parse(
      "# who\n\n  ana\toperator " + HashOfToken(token) + "\nnode7 reader cert:node7.lab\n", "f");
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_TRUE(file->FindToken(token).has_value());
  EXPECT_EQ(file->FindToken(token)->name, "ana");
  EXPECT_EQ(file->FindToken(token)->role, Role::kOperator);
  EXPECT_FALSE(file->FindToken(other).has_value());
  EXPECT_FALSE(file->FindToken("").has_value());
  EXPECT_FALSE(file->FindToken(HashOfToken(token)).has_value()) << "the hash opens what the token opens";
  EXPECT_EQ(file->FindCertificate({"node7", "node7.lab"})->role, Role::kReader);
  EXPECT_FALSE(file->FindCertificate({"node7.lab.example"}).has_value());
}

TEST(AccessFile, AMistakeNamesItsLineAndNeverTheCredential) {
  const std::string token = NewAccessToken();
  const std::vector<std::string> lines = {"ana operator " + token,
                                          "ana " + token,
                                          token,
                                          "ana operator sha256:" + token,
                                          "ana king " + HashOfToken(token),
                                          token + " " + token + " " + token,
                                          "ana reader cert:"};
  for (const std::string& line : lines) {
    const auto file = AccessFile::Parse("# first\n" + line + "\n", "tokens");
    ASSERT_FALSE(file.ok()) << line;
    EXPECT_THAT(Message(file.status()), AllOf(HasSubstr("tokens:2: "), Not(HasSubstr(token))));
  }
}

TEST(ServerFlags, TakeWhoMayCall) {
  const char* arguments[] = {"touchstone-server",
                             "--listen",
                             "0.0.0.0:1",
                             "--tls-cert",
                             "a.pem",
                             "--tls-key",
                             "a.key",
                             "--tls-client-ca",
                             "ca.pem",
                             "--token-file",
                             "tokens",
                             "--client-cert-role",
                             "admin"};
  const auto flags = ParseServerFlags(13, arguments);
  ASSERT_TRUE(flags.ok()) << flags.status();
  EXPECT_EQ(flags->options.access.tls_client_ca, "ca.pem");
  EXPECT_EQ(flags->options.access.client_cert_role, "admin");
  EXPECT_FALSE(flags->options.access.insecure);
  ServerFlags of_file;
  EXPECT_TRUE(ApplyToml("insecure = true\ntoken_file = \"t\"\n", "a.toml", &of_file).ok());
  EXPECT_TRUE(of_file.options.access.insecure);
}

}  // namespace
}  // namespace touchstone::service
