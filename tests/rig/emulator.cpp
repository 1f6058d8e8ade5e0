#include "tests/rig/emulator.h"

#include <unistd.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "server/base/text/text.h"
#include "server/geometry/surface/surface.h"
#include "tests/rig/emulator_commands.h"
#include "tests/rig/emulator_files.h"
#include "tests/rig/world/camera.h"
#include "tests/rig/world/device.h"
#include "tests/rig/world/hidden_physics.h"
#include "tests/rig/world/tcp_server.h"

namespace touchstone::rig {
namespace {

constexpr double kBaud = 115200, kBitsAByte = 10;

// A mesh for the camera; its triangles are the oracle's.
std::shared_ptr<const geometry::Surface> SurfaceOf(const hidden::Solid& solid) {
  geometry::TriangleMesh mesh;
  for (const Eigen::Vector3d& vertex : solid.triangles().vertices_mm)
    mesh.vertices_m.push_back((vertex * 1e-3).cast<float>());
  mesh.triangles = solid.triangles().corners;
  auto surface = geometry::Surface::Create(solid.name(), std::move(mesh));
  if (!surface.ok()) throw std::runtime_error(std::string(surface.status().message()));
  return *surface;
}

std::string ProgramBeside() {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return "";
  const auto program = self.parent_path() / "touchstone-rig-emulator";
  return std::filesystem::exists(program, error) ? program.string() : "";
}

class Log {
 public:
  explicit Log(const std::string& path) : file_(path, std::ios::app) {}
  void Write(const std::string& text) {
    std::lock_guard<std::mutex> lock(mutex_);
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    gmtime_r(&now, &utc);
    char time[32];
    std::strftime(time, sizeof time, "%Y-%m-%dT%H:%M:%SZ", &utc);
    file_ << time << " [emulated rig] " << text << std::endl;
  }

 private:
  std::mutex mutex_;
  std::ofstream file_;
};

class TheEmulator : public Emulator {
 public:
  explicit TheEmulator(const EmulatorOptions& options);

  std::string config_path() const override { return options_.dir + "/gateway.toml"; }
  std::string calibration_path() const override { return options_.dir + "/calibration.yaml"; }
  std::string port_path() const override { return options_.dir + "/effector"; }
  std::string control_address() const override {
    return options_.address + ":" + std::to_string(control_->port());
  }
  std::string camera_url() const override {
    return "http://" + options_.address + ":" + std::to_string(camera_->port()) + "/video.mjpg";
  }
  const EmulatorOptions& options() const override { return options_; }

  const SimClock& clock() const override { return *clock_; }
  Faults& faults() override { return faults_; }
  Controller& controller() override { return *controller_; }
  Device& device() override { return *device_; }
  EmulatedCamera& camera() override { return *camera_; }

  std::vector<TouchTruth> Touches() const override { return fingers_->Touches(); }
  uint64_t touches() const override { return fingers_->touches(); }
  std::string Mount(const std::string& object, const std::string& up_face) override {
    if (controller_->Moving()) return "the emulated arm is moving; nobody reaches under it";
    return fingers_->Mount(object, up_face);
  }
  std::string Tell(const std::string& line) override {
    const CommandHooks hooks{[this] { fingers_->RestartSession(); }, [this] { quit_ = true; },
                             [this] { return Ports(); }};
    const std::string answer = AnswerCommand(line, this, hooks);
    log_->Write("told '" + line + "': " + answer.substr(0, 200));
    return answer;
  }
  bool QuitAsked() const override { return quit_; }

 private:
  CameraView Look() const;
  std::string Ports() const {
    auto text = ReadFile(options_.dir + "/emulator.json");
    return text.ok() ? nlohmann::ordered_json::parse(*text).dump() : std::string(text.status().message());
  }

  EmulatorOptions options_;
  std::atomic<bool> quit_{false};
  Faults faults_;
  std::unique_ptr<Log> log_;
  std::map<std::string, std::shared_ptr<const geometry::Surface>> surfaces_;
  // In this order each needs only those before it; the threads of the later ones end first.
  std::unique_ptr<SimClock> clock_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<Fingers> fingers_;
  std::unique_ptr<Controller> controller_;
  std::unique_ptr<EmulatedCamera> camera_;
  std::unique_ptr<TcpServer> control_;
};

TheEmulator::TheEmulator(const EmulatorOptions& options) : options_(options) {
  if (options.dir.empty()) throw std::invalid_argument("the emulator needs a folder for its files");
  if (!(options.speedup > 0)) throw std::invalid_argument("the speed-up must be above 0");
  if (!(options.sigma_us >= 0)) throw std::invalid_argument("sigma_us must be at least 0");
  if (options.arm != "ur3" && options.arm != "ur3e")
    throw std::invalid_argument("no arm is called '" + options.arm + "'; there are ur3, ur3e");
  if (options.fingers < 1 || options.fingers > 8)
    throw std::invalid_argument(std::to_string(options.fingers) + " fingers; must be 1 to 8");
  if (options.camera_width < 1 || options.camera_width > 2048 || options.camera_height < 1 ||
      options.camera_height > 2048)
    throw std::invalid_argument("the camera's pictures have " + std::to_string(options.camera_width) + " x " +
                                std::to_string(options.camera_height) + " pixels; must be 1 to 2048 a side");
  if (options.jpeg_quality < 1 || options.jpeg_quality > 100)
    throw std::invalid_argument("the JPEG quality is " + std::to_string(options.jpeg_quality) +
                                "; must be 1 to 100");
  std::filesystem::create_directories(options.dir);
  options_.dir = std::filesystem::canonical(options.dir).string();
  for (std::string& mesh : options_.meshes)
    if (const size_t equals = mesh.find('='); equals != std::string::npos)
      mesh = mesh.substr(0, equals + 1) + std::filesystem::absolute(mesh.substr(equals + 1)).string();
  log_ = std::make_unique<Log>(options_.dir + "/emulator.log");
  log_->Write(kNotice);

  hidden::Scenario scenario;
  scenario.fingers = options.fingers, scenario.spacing_mm = options.spacing_mm,
  scenario.sigma_us = options.sigma_us;
  scenario.objects = ReadObjects(options_.meshes, options.supershape_triangles);
  CameraOptions camera;
  for (const std::string& each : options.hide)
    if (HideInCamera(each, &camera.hidden))
      camera.anything_hidden = true;
    else
      Hide(each, &scenario);
  for (const std::string& each : options.unlisted) AddUnlisted(each, &scenario);
  std::map<std::string, Eigen::Isometry3d> base_from_object;
  for (const auto& object : scenario.objects) {
    base_from_object[object->name()] = FixtureOf(object->low_mm() * 1e-3, object->high_mm() * 1e-3);
    surfaces_[object->name()] = SurfaceOf(*object);
  }
  clock_ = std::make_unique<SimClock>(options.speedup, ClockFile(options_));
  faults_.Follow(clock_.get());
  for (const auto& [name, value] : options.faults)
    if (const std::string error = faults_.Set(name, value); !error.empty())
      throw std::invalid_argument(error);

  DeviceOptions device;
  device.link = port_path();
  device.fingers = options.fingers, device.sensor = options.sensor, device.drift_ppm = options.drift_ppm;
  device.byte_s = options.pace_baud ? kBitsAByte / kBaud : 0;
  device.unplug_resets = options.unplug_resets, device.seed = options.seed;
  device_ = std::make_unique<Device>(device, clock_.get(), &faults_);
  fingers_ = std::make_unique<Fingers>(scenario, options.seed, base_from_object, &faults_,
                                       [this](const Edge& edge) { device_->OnEdge(edge); });
  if (!options.object.empty())
    if (const std::string error = fingers_->Mount(options.object, options.up_face); !error.empty())
      throw std::invalid_argument(error);

  ControllerOptions controller;
  controller.model = options.arm, controller.address = options.address;
  controller.dashboard_port = options.dashboard_port, controller.primary_port = options.primary_port;
  controller.secondary_port = options.secondary_port, controller.rtde_port = options.rtde_port;
  controller.calibrated = options.calibrated;
  controller.powered = options.powered, controller.seed = options.seed;
  controller.finger_give_m = options.finger_give_mm * 1e-3;
  controller_ = Controller::Start(controller, clock_.get(), &faults_, fingers_.get());

  camera.width = options.camera_width, camera.height = options.camera_height;
  camera.jpeg_quality = options.jpeg_quality;
  camera.address = options.address, camera.port = options.camera_port, camera.seed = options.seed;
  camera.vertical_fov_rad = kVerticalFovDeg * M_PI / 180;
  camera_ = std::make_unique<EmulatedCamera>(
      camera, [this] { return Look(); }, clock_.get(), &faults_);
  control_ =
      std::make_unique<TcpServer>(options.address, options.control_port, [this](LineConnection& connection) {
        for (std::string line; connection.ReadLine(&line);)
          if (!connection.Send(Tell(line) + "\n")) return;
      });

  EmulatorAddresses addresses;
  addresses.arm = controller_->ports();
  addresses.camera_port = camera_->port(), addresses.control_port = control_->port();
  addresses.program = options.program.empty() ? ProgramBeside() : options.program;
  WriteCalibration(options_, base_from_object);
  WriteAddresses(options_, addresses);
  WriteGatewayConfig(options_, addresses);
  std::string hidden = "hidden:";
  for (const auto* list : {&options_.hide, &options_.unlisted})
    for (const std::string& each : *list) hidden += " " + each;
  log_->Write(hidden);
  log_->Write("ready; " + Ports());
}

CameraView TheEmulator::Look() const {
  CameraView view;
  const auto base_from_mesh = fingers_->BaseFromMesh();
  const auto surface = surfaces_.find(fingers_->object());
  if (!base_from_mesh || surface == surfaces_.end()) return view;
  view.surface = surface->second;
  view.mesh_from_camera =
      base_from_mesh->inverse() * Eigen::Affine3d(controller_->BaseFromFlange() * FlangeFromCamera());
  return view;
}

}  // namespace

std::unique_ptr<Emulator> Emulator::Start(const EmulatorOptions& options) {
  return std::make_unique<TheEmulator>(options);
}

}  // namespace touchstone::rig
