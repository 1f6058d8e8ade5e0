#include "tests/rig/emulator.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include <nlohmann/json.hpp>

#include "server/base/test_folder.h"
#include "tests/rig/world/camera.h"
#include "tests/rig/world/device.h"
#include "tests/rig/world/tcp_server.h"

namespace touchstone::rig {
namespace {

constexpr double kPatienceS = 30;  // of the host: a loaded machine

// An emulated rig with a box of 150 x 100 x 60 mm on its fixture.
class EmulatorTest : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream off(folder_.Path("box.off"));
    off << "OFF\n8 12 0\n";
    for (int k = 0; k < 8; ++k)
      off << (k & 1 ? 75 : -75) << ' ' << (k & 2 ? 50 : -50) << ' ' << (k & 4 ? 30 : -30) << '\n';
    for (const char* face : {"0 2 1", "1 2 3", "4 5 6", "5 7 6", "0 1 4", "1 5 4", "2 6 3", "3 6 7", "0 4 2",
                             "2 4 6", "1 3 5", "3 7 5"})
      off << "3 " << face << '\n';
    off.close();
    EmulatorOptions options;
    options.dir = folder_.Path("rig"), options.meshes = {"box=" + folder_.Path("box.off")};
    options.sigma_us = 0, options.powered = true, options.speedup = 20, options.program = "/usr/bin/true";
    options.hide = {"channel_latency.latency_us=1000,0,-1000"};
    emulator_ = Emulator::Start(options);
  }
  std::string Text(const std::string& path) {
    std::ifstream file(path);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }

  const TestFolder folder_;
  std::unique_ptr<Emulator> emulator_;
};

TEST_F(EmulatorTest, WritesWhatAGatewayNeedsAndSaysThatItIsEmulated) {
  for (const std::string& path : {emulator_->config_path(), emulator_->calibration_path(),
                                  folder_.Path("rig/emulator.json"), folder_.Path("rig/emulator.log")})
    EXPECT_NE(Text(path).find("emulated rig"), std::string::npos) << path;
  const std::string config = Text(emulator_->config_path());
  for (const char* key :
       {"journal = ", "audit_log = ", "calibration = ", "provenance_note = ", "emulated = true\n",
        "time_scale = 20\n", "emulated_clock = ", "mount_command = [\"/usr/bin/true\", \"tell\", ",
        "mesh = [\"box=", "[arm]\nmodel = \"ur3e\"",
        "rtde_port = ", "[effector]\nport = ", "sensor = \"optical\"", "[camera]\nuri = \"http://"})
    EXPECT_NE(config.find(key), std::string::npos) << key << "\n" << config;
  // The box stands on the plate, 75 mm below the base.
  EXPECT_NE(Text(emulator_->calibration_path()).find("box: {translation_mm: [300, 0, -45]"),
            std::string::npos);
  EXPECT_TRUE(std::filesystem::is_symlink(emulator_->port_path()));
}

TEST_F(EmulatorTest, IsToldThingsOverItsControlPort) {
  const auto tell = [&](const std::string& line) {
    return AskOnce(emulator_->control_address(), line, kPatienceS);
  };
  EXPECT_EQ(tell("mount box -x"), "ok box -x");
  EXPECT_EQ(tell("mount ball +z").rfind("error there is no object 'ball'", 0), 0u);
  EXPECT_EQ(tell("mount box up").rfind("error no face", 0), 0u);
  EXPECT_EQ(tell("fault drop_bytes 0.25").rfind("ok", 0), 0u);
  EXPECT_EQ(emulator_->faults().Get("drop_bytes"), 0.25);
  EXPECT_NE(tell("faults").find("drop_bytes=0.25"), std::string::npos);
  EXPECT_EQ(tell("fault drop_bytes much").rfind("error", 0), 0u);
  EXPECT_EQ(tell("fault ghosts 1").rfind("error", 0), 0u);
  EXPECT_EQ(tell("press").rfind("ok", 0), 0u);
  EXPECT_EQ(emulator_->faults().Get("emergency_stop"), 1);
  EXPECT_EQ(tell("hide tip_radius.radius_mm=1").rfind("error", 0), 0u);
  EXPECT_EQ(tell("count"), "ok 0");
  EXPECT_EQ(tell("truth").rfind("error", 0), 0u);
  EXPECT_EQ(tell("dance").rfind("error", 0), 0u);
  EXPECT_FALSE(emulator_->QuitAsked());
  EXPECT_EQ(tell("quit").rfind("ok", 0), 0u);
  EXPECT_TRUE(emulator_->QuitAsked());
}

TEST_F(EmulatorTest, TouchesTheBoxWhereItIsAsAProgramMovesTheArm) {
  ASSERT_EQ(emulator_->Mount("box", "+z"), "");
  const std::string dashboard = "127.0.0.1:" + std::to_string(emulator_->controller().ports().dashboard);
  AskOnce(dashboard, "brake release", kPatienceS);  // answered with the banner
  // The upper face is at -0.015; the touch begins 50 mm above it.
  const std::string program =
      "def touch():\n  set_tcp(p[0,0,0.12,0,0,0])\n  movel(p[0.30,0,0.10,3.14159265358979,0,0],1.2,0.25)\n"
      "  movel(p[0.30,0,0.035,3.14159265358979,0,0],1.2,0.25)\n"
      "  movel(p[0.30,0,-0.025,3.14159265358979,0,0],1.2,0.02)\n"
      "  movel(p[0.30,0,0.035,3.14159265358979,0,0],1.2,0.1)\nend\n";
  const std::string secondary = "127.0.0.1:" + std::to_string(emulator_->controller().ports().secondary);
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
  std::vector<TouchTruth> touches;
  while (std::chrono::steady_clock::now() < until && (touches.empty() || !touches[0].ended)) {
    // Refused while the brakes are still being released.
    if (emulator_->controller().Count("programs") == 0) {
      try {
        AskOnce(secondary, program, 1);
      } catch (const std::runtime_error&) {
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    touches = emulator_->Touches();
  }
  ASSERT_EQ(touches.size(), 1u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(touches[0].travel_m[i], 0.05, 1e-6);
    EXPECT_NEAR(touches[0].contact_s[i], 0.05 / 0.02 + 0.02 / 1.2 / 2, 1e-4);
    EXPECT_NEAR(touches[0].reported_s[i] - touches[0].contact_s[i], 1e-3 * (1 - i), 1e-9);
  }
  const auto told = nlohmann::json::parse(emulator_->Tell("truth").substr(3));
  EXPECT_EQ(told["object"], "box");
  EXPECT_EQ(told["emulated"], true);
}

TEST(Emulator, RefusesOptionsThatMakeNoSense) {
  const TestFolder folder;
  for (const int which : {0, 1, 2, 3, 4, 5}) {
    EmulatorOptions options;
    options.dir = folder.path(), options.supershape_triangles = 200;
    if (which == 0) options.hide = {"ghost.size_mm=1"};
    if (which == 1) options.arm = "ur5";
    if (which == 2) options.sensor = "nose";
    if (which == 3) options.fingers = 9;
    if (which == 4) options.faults = {{"drop_bytes", 2}};
    if (which == 5) options.object = "lat99";
    EXPECT_ANY_THROW(Emulator::Start(options)) << which;
  }
}

}  // namespace
}  // namespace touchstone::rig
