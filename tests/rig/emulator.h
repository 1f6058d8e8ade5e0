// The whole emulated rig in one object: controller, end effector on a pseudo-terminal, camera, control
// port, and the files with which a touchstone-gateway drives it. A test tool: what it reports was never
// measured on anything.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/rig/controller.h"
#include "tests/rig/world.h"
#include "tests/rig/world/fingers.h"

namespace touchstone::rig {

struct EmulatorOptions {
  std::string dir;  // gets gateway.toml, calibration.yaml, emulator.json, emulator.log, effector; is made
  std::string arm = "ur3e";  // or "ur3"
  std::string address = "127.0.0.1";
  // 0: any free port.
  int dashboard_port = 0, primary_port = 0, secondary_port = 0, rtde_port = 0, camera_port = 0,
      control_port = 0;

  // "tip_radius.radius_mm=2", "radial_distortion.k1=-0.2": world/hidden_physics.h, world/hidden_camera.h
  std::vector<std::string> hide;
  std::vector<std::string> unlisted;  // "lead_screw=0.3,4"
  double sigma_us = 5000;             // Gaussian noise of every finger's time
  uint64_t seed = 1;
  std::vector<std::string> meshes;     // "NAME=FILE", mm; none: the five built-in supershapes
  int supershape_triangles = 20'000;   // as the virtual source has them
  std::string object, up_face = "+z";  // mounted from the beginning; empty: nothing

  bool camera = true;  // gateway.toml names it
  int camera_width = 640, camera_height = 480, jpeg_quality = 90;

  double speedup = 1;  // simulated seconds in one of the host's
  int fingers = 3;
  double spacing_mm = 30;
  std::string sensor = "optical";                      // "microswitch", "resistor"
  double drift_ppm = 20;                               // of the device's oscillator
  bool pace_baud = false;                              // bytes take their time at 115200 baud, simulated
  bool unplug_resets = false;                          // the device takes its power from the line
  std::vector<std::pair<std::string, double>> faults;  // from the beginning
  bool calibrated = false;                             // the arm's kinematics have deltas of their own
  bool powered = true;                                 // the arm; else it is off as after switching on
  double finger_give_mm = 60;                          // farther beyond a contact: protective stop
  // The program that gateway.toml's mount_command calls; empty: touchstone-rig-emulator beside the running
  // program, and no mount_command if there is none.
  std::string program;
};

class Device;
class EmulatedCamera;

class Emulator {
 public:
  // Returns when everything listens and the files are written. Throws
  // std::runtime_error or std::invalid_argument.
  static std::unique_ptr<Emulator> Start(const EmulatorOptions& options);
  virtual ~Emulator() = default;

  virtual std::string config_path() const = 0;       // DIR/gateway.toml
  virtual std::string calibration_path() const = 0;  // DIR/calibration.yaml
  virtual std::string port_path() const = 0;         // DIR/effector
  virtual std::string control_address() const = 0;   // "127.0.0.1:41234"
  virtual std::string camera_url() const = 0;        // "http://127.0.0.1:41235/video.mjpg"
  virtual const EmulatorOptions& options() const = 0;

  virtual const SimClock& clock() const = 0;
  virtual Faults& faults() = 0;
  virtual Controller& controller() = 0;
  virtual Device& device() = 0;
  virtual EmulatedCamera& camera() = 0;

  // What really happened, oldest first; at most the last 10,000 approaches with a contact.
  virtual std::vector<TouchTruth> Touches() const = 0;
  virtual uint64_t touches() const = 0;
  // An error text, or empty.
  virtual std::string Mount(const std::string& object, const std::string& up_face) = 0;
  // What the control port answers to a line: "ok ..." or "error ...".
  virtual std::string Tell(const std::string& line) = 0;
  // Whether the control port was told to quit.
  virtual bool QuitAsked() const = 0;
};

}  // namespace touchstone::rig
