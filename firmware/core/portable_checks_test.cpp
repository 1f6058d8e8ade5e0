#include "firmware/core/portable_checks.h"

#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "server/base/test_paths.h"

namespace touchstone::firmware {
namespace {

std::string ReadVectors() {
  std::ifstream file(SourceDir() + "/firmware/vectors.txt");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class Portable : public testing::TestWithParam<int> {};

TEST_P(Portable, Holds) {
  const std::string vectors = ReadVectors();
  ASSERT_FALSE(vectors.empty()) << "firmware/vectors.txt is missing";
  const char* failure = kPortableChecks[GetParam()].run(vectors.c_str());
  EXPECT_EQ(failure, nullptr) << failure;
}

INSTANTIATE_TEST_SUITE_P(Checks, Portable, testing::Range(0, kPortableCheckCount),
                         [](const auto& info) { return std::string(kPortableChecks[info.param].name); });

}  // namespace
}  // namespace touchstone::firmware
