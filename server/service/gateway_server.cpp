#include "server/service/gateway_server.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/gateway/arm/ur_arm.h"
#include "server/gateway/rig/rig.h"
#include "server/service/journal_sessions_service.h"
#include "server/service/rig_service.h"
#include "server/service/serving.h"
#include "server/service/source_service.h"
#include "server/source/physical_source.h"
#include "server/source/recorded_rig.h"

namespace touchstone {
namespace {

absl::StatusOr<std::unique_ptr<Rig>> OpenRig(const GatewayOptions& options) {
  RigParts parts;
  parts.changes = std::make_unique<ChangeNotifier>();
  TOUCHSTONE_ASSIGN_OR_RETURN(const Calibration calibration, ReadCalibration(options.calibration));
  MotionLimits limits = options.limits;
  limits.outermost_finger_m = 0.5 * (options.effector.fingers.size() - 1) * options.spacing_mm / 1000;
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.planner, MotionPlanner::Create(options.arm.model, limits, calibration));
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.journal,
                              Journal::Open(options.journal, Journal::Mode::kCreateOrReadWrite));
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.audit, AuditLog::Open(options.audit_log));

  UrArmOptions arm;
  arm.model = options.arm.model;
  arm.address = options.arm.address;
  arm.dashboard_port = options.arm.dashboard_port;
  arm.primary_port = options.arm.primary_port;
  arm.secondary_port = options.arm.secondary_port;
  arm.rtde_port = options.arm.rtde_port;
  arm.frozen_after_s = options.arm.silence_s;
  arm.script.flange_from_tip = calibration.flange_from_tip;
  arm.script.payload_kg = options.limits.payload_kg;
  arm.script.transit_speed_m_s = options.limits.transit_speed_m_s;
  arm.script.acceleration_m_s2 = options.limits.acceleration_m_s2;
  arm.script.time_scale = options.time_scale;
  arm.script.watchdog_hz = options.arm.watchdog_hz;
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.arm, ConnectUrArm(arm, parts.changes.get()));
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.effector, Effector::Open(options.effector, parts.changes.get()));
  if (!options.camera.uri.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(parts.camera, CameraDevice::Open(options.camera));
    parts.vertical_fov_rad = options.camera.vertical_fov_rad;
    if (!options.camera.intrinsics.empty()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(parts.intrinsics, ReadIntrinsics(options.camera.intrinsics));
    }
  }

  RigOptions rig;
  rig.fingers = static_cast<int>(options.effector.fingers.size());
  rig.spacing_m = options.spacing_mm / 1000;
  rig.time_scale = options.time_scale;
  rig.max_overtravel_m = options.max_overtravel_mm / 1000;
  rig.mount_command = options.mount_command;
  rig.mount_timeout_s = options.mount_timeout_s;
  rig.provenance_note = options.provenance_note;
  rig.effector_port = options.effector.port;
  return Rig::Create(std::move(rig), std::move(parts));
}

}  // namespace

struct GatewayServer::Parts {
  Resources resources;
  std::unique_ptr<PhysicalSource> source;
  Rig* rig = nullptr;  // the source's device, if it is one
  std::unique_ptr<LeaseBook> leases;
  std::unique_ptr<SourceService> source_service;
  std::unique_ptr<ControlService> control;
  std::unique_ptr<RigService> rig_service;
  std::unique_ptr<JournalSessionsService> sessions;
  std::unique_ptr<grpc::Server> server;
  int port = 0;
};

GatewayServer::GatewayServer() : parts_(std::make_unique<Parts>()) {}

absl::StatusOr<std::unique_ptr<GatewayServer>> GatewayServer::Start(GatewayOptions options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckServing(options.common));
  std::unique_ptr<GatewayServer> gateway(new GatewayServer);
  Parts& parts = *gateway->parts_;
  Resources& resources = parts.resources;
  resources.options = options.common;
  resources.pool = std::make_unique<ThreadPool>(0);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      resources.objects,
      ObjectStore::Load(options.common.meshes, options.common.supershape_triangles, resources.pool.get()));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.models, ModelStore::Open(""));
  Journal* journal = nullptr;
  std::unique_ptr<RigDevice> device;
  if (options.replay.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<Rig> rig, OpenRig(options));
    parts.rig = rig.get();
    journal = &rig->journal();
    device = std::move(rig);
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<RecordedRig> recorded, RecordedRig::Open(options.replay));
    journal = &recorded->journal();
    device = std::move(recorded);
  }
  const bool moves = device->moves();
  parts.source = std::make_unique<PhysicalSource>(&resources.objects, options.common.Limits(),
                                                  std::move(device), Rectify);
  parts.leases = std::make_unique<LeaseBook>(options.common.lease_window_s, moves);
  parts.source_service = std::make_unique<SourceService>(&resources, parts.leases.get(), parts.source.get());
  parts.sessions = std::make_unique<JournalSessionsService>(journal, moves);
  std::vector<ServedService> services = {{"touchstone.v1.Source", parts.source_service.get()},
                                         {"touchstone.v1.Sessions", parts.sessions.get()}};
  if (parts.rig != nullptr) {
    parts.control = std::make_unique<RigControlService>(&resources, parts.leases.get(), parts.rig);
    parts.rig_service = std::make_unique<RigService>(&resources, parts.leases.get(), parts.rig);
    services.push_back({"touchstone.v1.Rig", parts.rig_service.get()});
  } else {
    parts.control = std::make_unique<ControlService>(&resources, parts.leases.get());
  }
  services.push_back({"touchstone.v1.Control", parts.control.get()});
  TOUCHSTONE_ASSIGN_OR_RETURN(Serving serving, StartServing(options.common, services));
  parts.server = std::move(serving.server);
  parts.port = serving.port;
  return gateway;
}

GatewayServer::~GatewayServer() {
  if (parts_->server == nullptr) return;
  parts_->resources.draining = true;
  parts_->server->Shutdown(std::chrono::system_clock::now());
  parts_->server->Wait();
}

int GatewayServer::port() const {
  return parts_->port;
}

RigDevice& GatewayServer::device() {
  return parts_->source->device();
}

void GatewayServer::Drain() {
  // Running motions see this within a tick and stop the arm.
  parts_->resources.draining = true;
  StopServing(parts_->resources.options, parts_->server.get());
}

}  // namespace touchstone
