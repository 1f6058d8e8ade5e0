#include "server/gateway/bundle/aliases.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::gateway::bundle {
namespace {

TEST(Aliases, TheSameNameHasTheSameAliasWhereverItStands) {
  Aliases aliases;
  aliases.LearnHolder("ana@bench2 rig-run 4711 (ana, operator)");
  EXPECT_EQ(aliases.Text("ana@bench2 rig-stop 4712"), "person-1@host-1 rig-stop 4712");
  EXPECT_EQ(aliases.Text("Ana took it from bo@bench2:50061; bench2 is off"),
            "person-1 took it from person-2@host-1:50061; host-1 is off");
  EXPECT_EQ(aliases.Text("ana_rig, banana, Anabel"), "person-1_rig, banana, Anabel") << "whole words alone";
}

TEST(Aliases, AddressesOfEveryKindAreHosts) {
  Aliases aliases;
  EXPECT_EQ(aliases.Text("192.168.0.10:30004: connection refused"), "host-1:30004: connection refused");
  EXPECT_EQ(aliases.Text("ur3e at 192.168.0.10, end effector nano33ble 0.1.0 at /dev/ttyACM0"),
            "ur3e at host-1, end effector nano33ble 0.1.0 at /dev/ttyACM0");
  EXPECT_EQ(aliases.Text("fe80::1ff:fe23:4567:890a"), "host-2");
  EXPECT_EQ(aliases.Text("00:1a:2b:3c:4d:5e"), "host-3");
  EXPECT_EQ(aliases.Text("ipv4:192.168.0.10:51234"), "ipv4:host-1:51234");
  EXPECT_EQ(aliases.Text("arm.physics.example.edu"), "host-4");
  EXPECT_EQ(aliases.Text("http://ana:pw@192.168.0.10/video.mjpg"), "http://host-1/path-1.mjpg");
  EXPECT_EQ(aliases.Text("127.0.0.1:50061, localhost, 12:00:01, 0.2.0, 5.12.1"),
            "127.0.0.1:50061, localhost, 12:00:01, 0.2.0, 5.12.1");
}

TEST(Aliases, OfAFileOnlyItsKindStays) {
  Aliases aliases;
  EXPECT_EQ(aliases.Text("/home/ana/rig.db: no room"), "path-1.db: no room");
  EXPECT_EQ(aliases.Text("'/home/Ana Maria/My Rig/rig.db' and ~/x.toml and C:\\Users\\ana\\x.csv"),
            "'path-2.db' and path-3.toml and path-4.csv");
  EXPECT_EQ(aliases.Text("audit_log=/var/log/rig.jsonl"), "audit_log=path-5.jsonl");
  EXPECT_EQ(aliases.Text("20 mm/s, 3 of 7 N/m, meshes/lat00.stl"), "20 mm/s, 3 of 7 N/m, meshes/lat00.stl");
}

TEST(Aliases, KeysAndTokensAreHidden) {
  Aliases aliases;
  EXPECT_EQ(aliases.Text("token ts_k3yAbCdEf0123456789-_AbCdEf01234567890123 is refused"),
            "token secret-1 is refused");
  EXPECT_EQ(aliases.Text("new/0123456789abcdef0123456789abcdef/7"), "new/secret-2/7");
  EXPECT_EQ(aliases.Text("monday/lat20/7"), "monday/lat20/7");
}

TEST(Aliases, WhatSomebodyWroteIsLeftOut) {
  Aliases aliases;
  EXPECT_EQ(aliases.Text("stopped by ana@lab rig-stop 4711 (told Bo (Lab 3) to go); then reset"),
            "stopped by person-1@host-1 rig-stop 4711 ([left out]); then reset");
  EXPECT_EQ(aliases.Text(
                "by ana@lab rig-stop 4711 at ipv4:10.0.0.7:4000 (Bo) at noon, by ipv4:127.0.0.1:4 (cable)"),
            "by person-1@host-1 rig-stop 4711 at ipv4:host-2:4000 ([left out]) at noon, by ipv4:127.0.0.1:4 "
            "([left out])");
  EXPECT_EQ(aliases.Text("by the arm's controller (C203A0)"), "by the arm's controller (C203A0)");
  EXPECT_EQ(aliases.Note("for Dr. Bo"), "[left out]");
  EXPECT_EQ(aliases.Note(""), "");
  EXPECT_EQ(aliases.Counts().at("notes"), 4);
}

TEST(Aliases, SessionsAndWhatTheUserNamesAreReplaced) {
  Aliases aliases;
  aliases.Learn(AliasKind::kSession, "kestrel-monday");
  aliases.Learn(AliasKind::kHidden, "Project Kestrel");
  EXPECT_EQ(aliases.Text("kestrel-monday/lat20/7"), "session-1/lat20/7");
  EXPECT_EQ(aliases.Text("for project kestrel alone"), "for hidden-1 alone");
  aliases.LearnHolder("ana@bench2");
  EXPECT_EQ(aliases.Text("project kestrel, ana@bench2, kestrel-monday"),
            "hidden-1, person-1@host-1, session-1");
}

}  // namespace
}  // namespace touchstone::gateway::bundle
