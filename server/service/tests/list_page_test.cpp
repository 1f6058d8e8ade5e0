// Lists of models and sessions in pages, at a server that has them in folders.
#include "server/service/calls/list_page.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "server/base/test_folder.h"
#include "server/service/rpc/server.h"
#include "touchstone/v1/models.grpc.pb.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone::service {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class ListPageTest : public testing::Test {
 protected:
  ListPageTest() {
    for (const char* kind : {"models", "sessions"}) std::filesystem::create_directory(folder_.Path(kind));
    ServerOptions options;
    options.listen = "127.0.0.1:0";
    options.supershape_triangles = 2000;
    options.models_dir = folder_.Path("models");
    options.sessions_dir = folder_.Path("sessions");
    options.max_page_size = 3;
    server_ = *Server::Start(options);
    channel_ =
        grpc::CreateChannel(absl::StrCat("127.0.0.1:", server_->port()), grpc::InsecureChannelCredentials());
  }

  void AddSession(const std::string& name) {
    std::ofstream(absl::StrCat(folder_.Path("sessions"), "/", name, ".csv")) << "object,t_0_us\ncup,1\n";
  }

  void AddModel(const std::string& name, size_t padding = 0) {
    std::ofstream(absl::StrCat(folder_.Path("models"), "/", name, ".yaml"))
        << "touchstone: model/1\nname: " << name << "\n# " << std::string(padding, 'x') << "\neffects: []\n";
  }

  grpc::Status Page(int page_size, const std::string& token, v1::ListSessionsResponse* response) {
    v1::ListSessionsRequest request;
    request.set_page_size(page_size);
    request.set_page_token(token);
    grpc::ClientContext context;
    return v1::Sessions::NewStub(channel_)->ListSessions(&context, request, response);
  }

  // The names of one page; `token` is what asked for it, and then what asks for the next one.
  std::vector<std::string> SessionNames(int page_size, std::string* token) {
    v1::ListSessionsResponse response;
    const grpc::Status status = Page(page_size, *token, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    *token = response.next_page_token();
    std::vector<std::string> names;
    for (const v1::Session& session : response.sessions()) names.push_back(session.name());
    return names;
  }

  std::vector<std::string> ModelNames(std::string* token) {
    v1::ListModelsRequest request;
    request.set_page_token(*token);
    v1::ListModelsResponse response;
    grpc::ClientContext context;
    const grpc::Status status = v1::Models::NewStub(channel_)->ListModels(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    *token = response.next_page_token();
    std::vector<std::string> names;
    for (const v1::Model& model : response.models()) names.push_back(model.name());
    return names;
  }

  const TestFolder folder_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

TEST_F(ListPageTest, SessionsComeInPagesByName) {
  for (const char* name : {"e", "b", "d", "a", "c"}) AddSession(name);
  std::string token;
  EXPECT_THAT(SessionNames(2, &token), ElementsAre("a", "b"));
  EXPECT_THAT(SessionNames(2, &token), ElementsAre("c", "d"));
  EXPECT_THAT(SessionNames(2, &token), ElementsAre("e"));
  EXPECT_EQ(token, "");
  // As many as the server gives, whether nothing or too much is asked for.
  for (const int size : {0, 1000}) {
    token.clear();
    EXPECT_THAT(SessionNames(size, &token), ElementsAre("a", "b", "c"));
    EXPECT_NE(token, "");
  }
}

TEST_F(ListPageTest, APageThatEndsTheListSaysSo) {
  std::string token;
  EXPECT_THAT(SessionNames(2, &token), ElementsAre());
  EXPECT_EQ(token, "");
  for (const char* name : {"a", "b"}) AddSession(name);
  EXPECT_THAT(SessionNames(2, &token), ElementsAre("a", "b"));
  EXPECT_EQ(token, "");
}

TEST_F(ListPageTest, WhatComesAndGoesBetweenPagesHidesNothing) {
  for (const char* name : {"a", "b", "c", "d"}) AddSession(name);
  std::string token;
  EXPECT_THAT(SessionNames(2, &token), ElementsAre("a", "b"));
  std::filesystem::remove(folder_.Path("sessions/b.csv"));  // with which the page ended
  std::filesystem::remove(folder_.Path("sessions/a.csv"));
  AddSession("bb");
  EXPECT_THAT(SessionNames(3, &token), ElementsAre("bb", "c", "d"));
}

TEST_F(ListPageTest, AFileThatIsNoSessionIsLeftOut) {
  for (const char* name : {"a", "c"}) AddSession(name);
  std::ofstream(folder_.Path("sessions/b.csv")) << "no measurement file";
  std::string token;
  EXPECT_THAT(SessionNames(3, &token), ElementsAre("a", "c"));
}

TEST_F(ListPageTest, ModelsComeInPagesByName) {
  for (const char* name : {"a", "b", "c", "d"}) AddModel(name);
  std::string token;
  EXPECT_THAT(ModelNames(&token), ElementsAre("a", "b", "c"));
  EXPECT_THAT(ModelNames(&token), ElementsAre("d", "nominal"));
  EXPECT_EQ(token, "");
}

TEST_F(ListPageTest, ANegativePageIsRefused) {
  v1::ListSessionsResponse response;
  const grpc::Status status = Page(-1, "", &response);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(),
              HasSubstr("page_size = -1: 0 (as many as the source gives, 3) or more"));
}

TEST(FillPageTest, APageOfLargeEntriesEndsEarlyButNeverEmpty) {
  const std::vector<size_t> bytes = {kPageBytes / 2, kPageBytes, 10 * kPageBytes, 1};
  const auto key_of = [](size_t entry) { return absl::StrCat(entry); };
  std::vector<std::vector<size_t>> pages;
  absl::Span<const size_t> left = bytes;
  for (std::string token = "first"; !token.empty();) {
    std::vector<size_t> page;
    token.clear();
    FillPage(
        left, 100, [&](size_t entry) { return page.push_back(entry), entry; }, key_of, &token);
    left.remove_prefix(page.size());
    ASSERT_FALSE(page.empty());
    EXPECT_EQ(token, left.empty() ? "" : absl::StrCat(page.back()));
    pages.push_back(page);
  }
  EXPECT_THAT(pages,
              ElementsAre(ElementsAre(bytes[0], bytes[1]), ElementsAre(bytes[2]), ElementsAre(bytes[3])));
}

}  // namespace
}  // namespace touchstone::service
