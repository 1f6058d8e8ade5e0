#include "server/gateway/bundle/anonymous.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::gateway::bundle {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(AnonymousConfig, KeepsSettingsAndNoNames) {
  Aliases aliases;
  const auto toml = AnonymousConfig(R"(# of Ana's rig
listen = "bench2.lab:50061"
journal = "/home/ana/rig.db"
token_file = "anas tokens.txt"
provenance_note = "Ana's print, batch 7"
mesh = ["mug=/home/ana/mug.stl,unit=mm"]
mount_command = ["/opt/robot/put", "{object}"]
emulated = true
[arm]
model = "ur3e"
address = "robot7"
silence_s = 0.5
[effector]
port = "/dev/ttyACM0"
sensor = ["optical"]
[camera]
uri = "http://ana:pw@cam/video.mjpg"
[limits]
box_min_mm = [-400, -100, 0]
)",
                                    "rig.toml", &aliases);
  ASSERT_TRUE(toml.ok()) << toml.status();
  for (const char* kept : {"ur3e", "silence_s = 0.5", "/dev/ttyACM0", "optical", "emulated = true", "-400",
                           ".db'", "50061", "unit=mm", "{object}"})
    EXPECT_THAT(*toml, HasSubstr(kept));
  for (const char* name : {"ana", "Ana", "bench2", "robot7", "pw", "/opt", "batch", "cam/", "mug.stl"})
    EXPECT_THAT(*toml, Not(HasSubstr(name)));
  EXPECT_EQ(aliases.Text("robot7: connection refused"),
            aliases.Of(AliasKind::kHost, "robot7") + ": connection refused");
  EXPECT_THAT(std::string(AnonymousConfig("a = ", "rig.toml", &aliases).status().message()),
              HasSubstr("rig.toml:1"));
}

TEST(AnonymousProvenance, KeepsWhatTouchedAndLeavesTheNoteOut) {
  Aliases aliases;
  EXPECT_EQ(
      AnonymousProvenance("for Bo; ur3e at robot7, end effector nano33ble 0.1.0 at /dev/ttyACM0", &aliases),
      "[left out]; ur3e at host-1, end effector nano33ble 0.1.0 at /dev/ttyACM0");
  EXPECT_EQ(AnonymousProvenance("imported from /home/ana/set.csv", &aliases), "imported from path-1.csv");
}

TEST(AnonymousPicture, LosesItsTextsAndNothingElse) {
  const std::string head = "\x89PNG\r\n\x1a\n";
  const auto chunk = [](const std::string& type, const std::string& data) {
    return std::string{'\0', '\0', '\0', static_cast<char>(data.size())} + type + data + "CRC.";
  };
  const std::string plain = head + chunk("IHDR", "x") + chunk("IDAT", "pixels") + chunk("IEND", "");
  const std::string spoken = head + chunk("IHDR", "x") + chunk("tEXt", "Author Ana") +
                             chunk("IDAT", "pixels") + chunk("eXIf", "lab 3") + chunk("IEND", "");
  EXPECT_EQ(WithoutTexts(spoken), plain);
  EXPECT_EQ(WithoutTexts(plain), plain);
  EXPECT_EQ(WithoutTexts(spoken.substr(0, 40)), spoken.substr(0, 40)) << "a damaged one stays as it is";
}

TEST(AnonymousLog, HasTheSessionsLinesAndThoseOfTheRigMeanwhile) {
  session::SessionContent content;
  content.session.name = "monday";
  content.session.created_unix_s = 1.7e9;  // 2023-11-14T22:13:20Z
  const std::string log =
      R"log({"time": "2023-11-14T22:00:00.000Z", "event": "stop", "who": "bo@lab", "reason": "earlier"}
{"time": "2023-11-14T22:14:00.000Z", "event": "touch_failed", "session": "monday", "id": "monday/lat20/3", "why": "stopped by ana@lab rig-stop 7 (cable)"}
{"time": "2023-11-14T22:14:00.100Z", "event": "touch_failed", "session": "tuesday", "id": "x", "why": "other"}
{"time": "2023-11-14T22:14:01.000Z", "event": "stop", "who": "ana@lab rig-stop 7", "reason": "cable"}
{"time": "2023-11-14T22:14:02.000Z", "ev)log";
  std::vector<nlohmann::ordered_json> lines = LinesOf(log, content);
  ASSERT_EQ(lines.size(), 2u);
  Aliases aliases;
  aliases.Learn(AliasKind::kSession, "monday");
  LearnFrom(lines, &aliases);
  Anonymise(&lines, &aliases);
  EXPECT_EQ(lines[0]["id"], "session-1/lat20/3");
  EXPECT_EQ(lines[0]["why"], "stopped by person-1@host-1 rig-stop 7 ([left out])");
  EXPECT_EQ(lines[1]["who"], "person-1@host-1 rig-stop 7");
  EXPECT_EQ(lines[1]["reason"], "[left out]");
}

}  // namespace
}  // namespace touchstone::gateway::bundle
