// What fuzzers found and what they begin with, read again, whole and damaged. Each reader must have come to accept
// something, or its inputs would only ever show how it refuses.
#include "tests/fuzz/parsers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>

#include "server/base/text/text.h"

namespace touchstone::fuzz {
namespace {

constexpr int kMutationsOfEach = 60;

// Where the build unpacks the archives of tests/fuzz/corpus (CMakeLists.txt): a folder for each reader.
std::filesystem::path Corpus() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path() / "tests/fuzz/corpus";
}

std::vector<std::string> FilesOf(const Parser& parser) {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(Corpus() / parser.name))
    paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::string Mutated(std::string bytes, std::mt19937_64* random) {
  for (uint64_t times = 1 + (*random)() % 4; times > 0 && !bytes.empty(); --times) {
    const size_t at = (*random)() % bytes.size();
    switch ((*random)() % 4) {
      case 0:
        bytes[at] = static_cast<char>((*random)());
        break;
      case 1:
        bytes.erase(at, 1 + (*random)() % 20);
        break;
      case 2:
        bytes.insert(at, bytes.substr((*random)() % bytes.size(), 1 + (*random)() % 20));
        break;
      default:
        bytes.resize(at);
        break;
    }
  }
  return bytes;
}

class ParserTest : public testing::TestWithParam<Parser> {};

TEST_P(ParserTest, ReadsItsCorpusAndDamagesOfItToAnAnswer) {
  const Parser& parser = GetParam();
  std::mt19937_64 random(1);
  int accepted = 0, refused = 0;
  const std::vector<std::string> paths = FilesOf(parser);
  for (const std::string& path : paths) {
    const auto bytes = ReadFile(path);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const Answer answer = parser.read(*bytes);
    ASSERT_NE(answer, Answer::kWrong) << path;
    accepted += answer == Answer::kAccepted;
    for (size_t k = 0; k < std::max<size_t>(1, kMutationsOfEach / paths.size()); ++k) {
      const std::string mutated = Mutated(*bytes, &random);
      const Answer damaged = parser.read(mutated);
      ASSERT_NE(damaged, Answer::kWrong) << path << ", damage " << k << ":\n" << mutated.substr(0, 2000);
      refused += damaged == Answer::kRefused;
    }
  }
  EXPECT_GT(accepted, 0) << "nothing of the corpus is ever accepted";
  EXPECT_GT(refused, 0) << "no damage is ever refused";
}

INSTANTIATE_TEST_SUITE_P(All, ParserTest, testing::ValuesIn(Parsers()),
                         [](const auto& test) { return test.param.name; });

TEST(Parsers, HaveACorpusEach) {
  std::vector<std::string> folders, names;
  for (const auto& entry : std::filesystem::directory_iterator(Corpus()))
    folders.push_back(entry.path().filename().string());
  for (const Parser& parser : Parsers()) names.push_back(parser.name);
  EXPECT_THAT(folders, testing::UnorderedElementsAreArray(names));
}

}  // namespace
}  // namespace touchstone::fuzz
