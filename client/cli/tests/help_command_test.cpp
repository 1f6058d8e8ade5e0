// touchstone help, version, completion, and the width of what they print.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>

#include "client/cli/tests/real_binary_test.h"
#include "server/base/test_tier.h"

namespace touchstone::cli {
namespace {

using ::testing::HasSubstr;

class HelpCommandTest : public RealBinaryTest {
 protected:
  // What bash offers for a word that is begun after `typed`.
  std::set<std::string> Offered(const std::string& typed, const std::string& begun) {
    Write("script", Run({"completion", "bash"}).out);
    Write("ask", "source ./script\nCOMP_WORDS=(touchstone " + typed + " '" + begun +
                     "')\nCOMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n_touchstone_complete\nprintf '%s\\n' "
                     "\"${COMPREPLY[@]}\" > offered\n");
    EXPECT_EQ(std::system(("cd '" + Path("") + "' && bash ask").c_str()), 0);
    const std::vector<std::string> lines = absl::StrSplit(Read("offered"), '\n', absl::SkipEmpty());
    return {lines.begin(), lines.end()};
  }

  // Standard output where that is a terminal of so many columns.
  std::string AtTerminal(unsigned short columns, const std::vector<std::string>& words,
                         const std::string& name = "touchstone") {
    winsize size{};
    size.ws_row = 24, size.ws_col = columns;
    int terminal = -1;
    const pid_t child = ::forkpty(&terminal, nullptr, nullptr, &size);
    if (child == 0) {
      std::string program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
      ::unsetenv("COLUMNS");
      std::vector<char*> raw = {program.data()};
      for (const std::string& word : words) raw.push_back(const_cast<char*>(word.c_str()));
      raw.push_back(nullptr);
      ::execv(raw[0], raw.data());
      ::_exit(98);
    }
    std::string text;
    char piece[4096];
    for (ssize_t n; (n = ::read(terminal, piece, sizeof piece)) > 0;)
      text.append(piece, static_cast<size_t>(n));
    ::close(terminal);
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
    return text;
  }
  size_t Longest(unsigned short columns, const std::vector<std::string>& words,
                 const std::string& name = "touchstone") {
    size_t length = 0;
    for (const absl::string_view line :
         absl::StrSplit(AtTerminal(columns, words, name), absl::ByAnyChar("\r\n")))
      length = std::max(length, line.size());
    return length;
  }
};

TEST_F(HelpCommandTest, HelpIsThatOfTheCommand) {
  EXPECT_EQ(Run({"help"}).out, Run({"--help"}).out);
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"diagnose"}, {"rig", "run"}, {"model"}}) {
    std::vector<std::string> asked = {"help"}, direct = words;
    asked.insert(asked.end(), words.begin(), words.end());
    direct.push_back("--help");
    EXPECT_EQ(Run(asked).out, Run(direct).out) << words[0];
  }
  EXPECT_EQ(Run({"help", "diagnos"}).exit_code, 2);
  EXPECT_THAT(Run({"help", "diagnos"}).err, HasSubstr("did you mean 'diagnose'?"));
  EXPECT_THAT(Run({"help", "doctor", "who"}).err,
              HasSubstr("'touchstone doctor' has no commands of its own"));
}

TEST_F(HelpCommandTest, VersionIsThatOfTheOption) {
  EXPECT_EQ(Run({"version"}).out, Run({"--version"}).out);
}

TEST_F(HelpCommandTest, BashCompletesCommandsAndOptions) {
  EXPECT_EQ(Offered("", "dia"), (std::set<std::string>{"diagnose"}));
  EXPECT_EQ(Offered("rig", "ru"), (std::set<std::string>{"run"}));
  EXPECT_EQ(Offered("diagnose set.csv", "--save-m"), (std::set<std::string>{"--save-model"}));
  EXPECT_TRUE(Offered("diagnose", "set").empty()) << "files are the shell's";
  EXPECT_EQ(Run({"completion", "tcsh"}).exit_code, 2);
}

TEST_F(HelpCommandTest, FishIsToldWhatEachCommandAndOptionIsFor) {
  const std::string script = Run({"completion", "fish"}).out;
  EXPECT_THAT(script,
              HasSubstr("\ncomplete -c touchstone -f -n '__touchstone_at --exactly' -a diagnose -d '"));
  EXPECT_THAT(script,
              HasSubstr("\ncomplete -c touchstone -f -n '__touchstone_at --exactly rig' -a run -d '"));
  EXPECT_THAT(script, HasSubstr("\ncomplete -c touchstone -n '__touchstone_at rig run' -l session -r -d '"));
  EXPECT_THAT(script,
              HasSubstr("\ncomplete -c touchstone -n '__touchstone_at rig run' -l help -s h -d 'This text'"));
}

TEST_F(HelpCommandTest, AManualPageSaysWhatHelpSays) {
  const std::string list = Run({"man", "--list"}).out;
  EXPECT_THAT(list, testing::StartsWith("touchstone\n"));
  EXPECT_THAT(list, HasSubstr("\ntouchstone rig run\n"));
  EXPECT_EQ(list.find("touchstone man"), std::string::npos) << "what help does not list";
  const std::string page = Run({"man", "rig", "bundle"}).out;
  EXPECT_THAT(page, testing::StartsWith(".TH TOUCHSTONE\\-RIG\\-BUNDLE 1 "));
  EXPECT_THAT(page, HasSubstr("\n.SH ARGUMENTS\n.TP\n.B SESSION\n"));
  EXPECT_THAT(page, HasSubstr("\n.B \\-o, \\-\\-output FILE\nThe bundle (.tar.gz) (required)\n"));
  EXPECT_THAT(page, HasSubstr("\n.SH EXAMPLES\n.nf\ntouchstone rig bundle monday"));
  EXPECT_THAT(page, HasSubstr(".SH SEE ALSO\n.BR touchstone (1),\n.BR touchstone\\-rig (1)\n"));
  EXPECT_EQ(Run({"man", "diagnos"}).exit_code, 2);
}

TEST_F(HelpCommandTest, TextIsAsWideAsTheTerminal) {
  for (const unsigned short columns : {60, 80, 120})
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"help"}, {"help", "model", "add"}, {"help", "capture"}, {"doctor"}, {"effects"}})
      EXPECT_LE(Longest(columns, words), columns) << words.back();
  EXPECT_GT(Longest(120, {"effects"}), 100u);
}

// Without room for four columns the last one stands below.
TEST_F(HelpCommandTest, WhatEffectsMeanStandsBelowTheirNamesOnANarrowTerminal) {
  const std::string narrow = absl::StrReplaceAll(AtTerminal(60, {"effects"}), {{"\r", ""}});
  EXPECT_THAT(narrow,
              testing::ContainsRegex("\ntip_radius +contact +radius_mm\n    The finger tips are spheres"));
  EXPECT_THAT(AtTerminal(120, {"effects"}),
              testing::ContainsRegex("tip_radius +contact +radius_mm +The finger tips"));
}

TEST_F(HelpCommandTest, TheHelpOfEveryProgramIsAsWideAsTheTerminal) {
  for (const char* program :
       {"touchstone-server", "touchstone-gateway", "touchstone-probe", "touchstone-rig-emulator"})
    for (const unsigned short columns : {60, 80, 120})
      EXPECT_LE(Longest(columns, {"--help"}, program), columns) << program;
}

TEST_F(HelpCommandTest, ColumnsIsTheWidthWhereThereIsNoTerminal) {
  ASSERT_EQ(::setenv("COLUMNS", "64", 1), 0);
  const std::string help = Run({"help", "diagnose"}).out;
  ::unsetenv("COLUMNS");
  size_t longest = 0;
  bool example = false;  // shown as it can be copied
  for (const absl::string_view line : absl::StrSplit(help, '\n')) {
    example = line == "Examples:" || (example && !line.empty());
    if (!example) longest = std::max(longest, line.size());
  }
  EXPECT_LE(longest, 64u);
  EXPECT_GT(longest, 50u);
}

TEST_F(HelpCommandTest, TheHelpOfEveryCommandIsAsWideAsTheTerminal) {
  TOUCHSTONE_SECOND_TIER("repeated: every command at every width");
  // What is done in Python has a test beside its parser.
  const std::set<std::string> in_python = {"export", "import", "verify", "recover", "worth"};
  const std::string list = Run({"man", "--list"}).out;
  for (const absl::string_view line : absl::StrSplit(list, '\n', absl::SkipEmpty())) {
    std::vector<std::string> words = absl::StrSplit(line, ' ');
    if (words.size() > 1 && in_python.count(words[1]) > 0) continue;
    words[0] = "help";
    for (const unsigned short columns : {60, 80, 120}) EXPECT_LE(Longest(columns, words), columns) << line;
  }
}

TEST_F(HelpCommandTest, ReportsHaveTheirStylesOnATerminalAndNoneElsewhere) {
  ASSERT_EQ(Run({"plan", "lat20", "--plan", "faces", "--samples-per-face", "2", "-o", "plan.csv"}).exit_code,
            0);
  ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "-o", "set.csv"}).exit_code, 0);
  const std::string shown = AtTerminal(80, {"compare", Path("set.csv"), "-q"});
  EXPECT_THAT(shown, HasSubstr("\x1b[1m"));
  EXPECT_EQ(shown.find("\\x1b"), std::string::npos) << "as codes, not as text";
  EXPECT_EQ(Run({"compare", "set.csv", "-q"}).out.find("\x1b"), std::string::npos);
}

TEST_F(HelpCommandTest, AnExampleThatIsTooWideCanStillBeCopied) {
  const std::string text = absl::StrReplaceAll(AtTerminal(80, {"help", "compare"}), {{"\r", ""}});
  EXPECT_THAT(text, HasSubstr("\n  touchstone compare set.csv --model nominal.yaml --model better.yaml \\\n"
                              "      --mesh-dir meshes\n      # which errs less\n"));
  EXPECT_THAT(Run({"help", "compare"}).out,
              HasSubstr("--model better.yaml --mesh-dir meshes   which errs less\n"))
      << "as it is where no terminal shows it";
}

}  // namespace
}  // namespace touchstone::cli
