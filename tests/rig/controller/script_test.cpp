#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/rig/controller/machine/machine.h"
#include "tests/rig/controller/script/program_reader.h"

namespace touchstone::rig {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

struct Played {
  explicit Played(const std::string& script, double seconds = 10) : machine(Options(), nullptr, nullptr) {
    machine.StartProgram(script);
    machine.Advance(seconds, nullptr);
    for (const Announcement& each : machine.TakeAnnouncements()) {
      if (each.kind == Announcement::kText) texts.push_back(each.text);
      if (each.kind == Announcement::kException) {
        exception = each.text;
        line = each.first;
      }
      if (each.kind == Announcement::kKey) started |= each.title == "PROGRAM_XXX_STARTED";
    }
  }
  static ControllerOptions Options() {
    ControllerOptions options;
    options.powered = true;
    options.position_noise_m = options.joint_noise_rad = 0;
    return options;
  }
  Machine machine;
  std::vector<std::string> texts;
  std::string exception;
  int line = 0;
  bool started = false;
};

std::vector<std::string> Texts(const std::string& body) {
  const Played run("def program():\n" + body + "end\n");
  EXPECT_EQ(run.exception, "");
  return run.texts;
}

TEST(Script, CalculatesWithTheUsualPrecedence) {
  EXPECT_THAT(
      Texts("textmsg(1 + 2 * 3)\ntextmsg((1 + 2) * 3)\ntextmsg(-2 - -3)\ntextmsg(7 % 4)\ntextmsg(1 / 4)\n"),
      ElementsAre("7", "9", "1", "3", "0.25"));
  EXPECT_THAT(Texts("textmsg(1 < 2 and not 2 < 1 or False)\ntextmsg(True xor True)\ntextmsg(1 == 1.0)\n"),
              ElementsAre("True", "False", "True"));
  EXPECT_THAT(Texts("textmsg(\"a\", 5)\ntextmsg([1, 2.5, True])\ntextmsg(p[0,0,0,0,0,1])\n"),
              ElementsAre("a5", "[1, 2.5, True]", "p[0, 0, 0, 0, 0, 1]"));
  EXPECT_THAT(
      Texts(
          "textmsg(norm([3, 4]))\ntextmsg(r2d(d2r(30)))\ntextmsg(sqrt(abs(-9)))\ntextmsg(sin(0) + cos(0))\n"),
      ElementsAre("5", "30", "3", "1"));
}

TEST(Script, BranchesAndLoops) {
  EXPECT_THAT(Texts(R"(
  i = 0
  while True:  # endless, but for break
    i = i + 1
    if i == 2:
      continue
    elif i > 4:
      break
    else:
      textmsg(i)
    end
  end
  textmsg("out ", i)
)"),
              ElementsAre("1", "3", "4", "out 5"));
  EXPECT_THAT(Texts("i = 0 while i < 2: i = i + 1 end textmsg(i)\n"), ElementsAre("2"));
  EXPECT_THAT(Texts("a = [1, 2, 3]\na[1] = 7\ntextmsg(a[1] + a[2])\n"), ElementsAre("10"));
}

TEST(Script, CallsFunctionsWithScopesOfTheirOwn) {
  EXPECT_THAT(Texts(R"(
  shared = 1
  def add(x, y):
    local shared = 100
    own = x + y
    return own
  end
  def change():
    shared = 2
    global made = 3
  end
  def faculty(n):
    if n < 2:
      return 1
    end
    return n * faculty(n - 1)
  end
  textmsg(add(2, 3))
  textmsg(shared)
  change()
  textmsg(shared + made)
  textmsg(faculty(5))
)"),
              ElementsAre("5", "1", "5", "120"));
}

// As ur_rtde's control program is written.
TEST(Script, CallsWhatIsDefinedBelowAndKnowsAVariableFromAPose) {
  EXPECT_THAT(Texts(R"(
  global offset = # the value is on the next line
24  def first(p):
    enter_critical
    p[0] = p[0] + second(p[1], offset)
    exit_critical
    return p
  end
  def second(x, y):
    return x + y
  end
  textmsg(first(p[1,2,3,0,0,0]))
)"),
              ElementsAre("p[27, 2, 3, 0, 0, 0]"));
}

TEST(Script, RunsThreadsThatCanBeJoinedAndKilled) {
  EXPECT_THAT(Texts(R"(
  count = 0
  thread counter():
    while True:
      count = count + 1
      sync()
    end
  end
  thread short(n):
    sleep(n)
    textmsg("slept")
  end
  handle = run counter()
  other = run short(0.5)
  join other
  kill handle
  before = count
  sleep(0.2)
  textmsg(before == count and count > 0)
)"),
              ElementsAre("slept", "True"));
}

TEST(Script, TakesArgumentsByNameInAnyOrder) {
  const Played run("movej(v=0.5, q=[0.2,-1.5,-1.5,-1.5,1.5,0], a=1)\n");
  EXPECT_EQ(run.exception, "");
  EXPECT_NEAR(run.machine.JointsAt(10)[0], 0.2, 1e-12);
}

TEST(Script, FindsTheJointsOfAPose) {
  const Played run(
      "def ik():\n q = get_inverse_kin(get_target_tcp_pose())\n movej(q)\n"
      " movej(pose_trans(get_target_tcp_pose(), p[0,0,0.02,0,0,0]))\n textmsg(is_steady())\nend\n");
  EXPECT_EQ(run.exception, "");
  EXPECT_THAT(run.texts, ElementsAre("True"));
}

TEST(Script, NeverStartsAProgramThatDoesNotCompile) {
  const std::pair<const char*, const char*> wrong[] = {
      {"def a():\n no_such_function(1)\nend\n", "name_not_found:no_such_function"},
      {"def a():\n textmsg(nothing)\nend\n", "name_not_found:nothing"},
      {"def a():\n movel()\nend\n", "compile_error_arguments:movel"},
      {"def a():\n movel(p[0,0,0,0,0,0], speed=3)\nend\n", "no parameter 'speed'"},
      {"def a():\n x = (1 + \nend\n", "syntax_error"},
      {"def a():\n x = p[1,2,3]\nend\n", "six numbers"},
      {"def a():\n break\nend\n", "outside of a loop"},
      {"def a():\n if 1 == 1\n end\nend\n", "expected ':'"},
      {"def a():\n x = \"open\nend\n", "does not end"},
      {"def this_name_has_more_than_31_characters():\nend\n", "more than 31"},
      {"x @ 1\n", "unexpected character"},
      {"end\n", "syntax_error"},
  };
  for (const auto& [script, why] : wrong) {
    const Played run(script);
    EXPECT_FALSE(run.started) << script;
    EXPECT_THAT(run.exception, HasSubstr(why)) << script;
  }
}

TEST(Script, EndsWithAnExceptionThatNamesTheLine) {
  const std::tuple<const char*, const char*, int> wrong[] = {
      {"def a():\n sync()\n x = 1 / 0\nend\n", "division by zero", 3},
      {"def a():\n while True:\n  x = 1\n end\nend\n", "infinite loop", 0},
      {"def a():\n x = [1]\n y = x[1]\nend\n", "out of range", 3},
      {"def a():\n write_output_integer_register(48, 1)\nend\n", "register 48", 2},
      {"def a():\n x = 1 + True\nend\n", "must be a number", 2},
      {"def a():\n if 1:\n end\nend\n", "True or False", 2},
      {"def a():\n def f(n):\n  return f(n)\n end\n f(1)\nend\n", "too deeply", 3},
      {"def a():\n q = get_inverse_kin(p[2,0,0,0,0,0])\nend\n", "reach", 2},
  };
  for (const auto& [script, why, line] : wrong) {
    const Played run(script);
    EXPECT_TRUE(run.started) << script;
    EXPECT_THAT(run.exception, HasSubstr(why)) << script;
    if (line > 0) {
      EXPECT_EQ(run.line, line) << script;
    }
    EXPECT_FALSE(run.machine.program_running());
  }
}

TEST(Script, LetsASecondaryProgramRunBesideButNotMove) {
  Played run("def first():\n sleep(5)\nend\n", 1);
  run.machine.StartProgram("sec beside():\n write_output_integer_register(2, 9)\nend\n");
  EXPECT_EQ(run.machine.registers().output_int[2], 9);
  run.machine.StartProgram("sec moves():\n movej([0,0,0,0,0,0])\nend\n");
  EXPECT_FALSE(run.machine.Moving());
  EXPECT_TRUE(run.machine.program_running());
  EXPECT_THAT(run.machine.TakeAnnouncements(), IsEmpty());
}

TEST(Script, LetsOneThreadMoveTheArmAtATime) {
  const Played run(
      "def both():\n thread t():\n  movej([0.5,-1.5,-1.5,-1.5,1.5,0])\n end\n x = run t()\n sleep(0.1)\n"
      " movej([0,-1.5,-1.5,-1.5,1.5,0])\nend\n");
  EXPECT_THAT(run.exception, HasSubstr("another thread"));
}

TEST(Script, SurvivesAnyCutAndAnySwappedCharacter) {
  const std::string script =
      "def a():\n x = [1, p[0,0,0,0,0,0]]\n if x[0] == 1 and not False:\n  textmsg(\"s\", x)\n"
      " elif True:\n  sync()\n end\n thread t():\n  sleep(0.1)\n end\n run t()\nend\n";
  for (size_t i = 0; i < script.size(); ++i) {
    Played cut(script.substr(0, i), 0.01);
    for (const char c : {'(', ']', '\n', '"', ':', '=', '\xff'}) {
      std::string changed = script;
      changed[i] = c;
      Played run(changed, 0.01);
    }
  }
  std::string deep(5000, '(');
  EXPECT_FALSE(Played("x = " + deep + "\n").started);
  EXPECT_FALSE(Played("x = " + std::string(5000, '-') + "1\n").started);
}

TEST(ProgramReader, FindsProgramsHoweverTheyAreCut) {
  const std::string program = "def a():\r\n  if True: # end of it\n    textmsg(\"end\")\n  end\nend\n";
  ProgramReader reader;
  std::vector<std::string> found;
  for (const char c : "\n# comment\n" + program + "movej([0,0,0,0,0,0])\nsec s():\nend\n")
    for (const std::string& each : reader.Feed(std::string(1, c))) found.push_back(each);
  EXPECT_THAT(found, ElementsAre(program, "movej([0,0,0,0,0,0])\n", "sec s():\nend\n"));
}

}  // namespace
}  // namespace touchstone::rig
