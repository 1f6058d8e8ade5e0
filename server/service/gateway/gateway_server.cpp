#include "server/service/gateway/gateway_server.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/gateway/arm/ur_arm.h"
#include "server/gateway/bundle/replay.h"
#include "server/gateway/rig/rig.h"
#include "server/gateway/timing/host_time.h"
#include "server/service/calls/request_guard.h"
#include "server/service/gateway/freedrive_service.h"
#include "server/service/gateway/journal_sessions_service.h"
#include "server/service/gateway/replay_service.h"
#include "server/service/gateway/rig_service.h"
#include "server/service/rpc/serving.h"
#include "server/service/rpc/source_service.h"
#include "server/service/rpc/status_pages.h"
#include "server/source/physical_source.h"
#include "server/source/recorded_rig.h"

namespace touchstone::service {
namespace {

absl::StatusOr<std::unique_ptr<gateway::Rig>> OpenRig(const GatewayOptions& options,
                                                      const source::ObjectStore& objects) {
  gateway::RigParts parts;
  parts.changes = std::make_unique<gateway::timing::ChangeNotifier>();
  TOUCHSTONE_ASSIGN_OR_RETURN(const gateway::calibration::Calibration calibration,
                              gateway::calibration::ReadCalibration(options.calibration));
  gateway::arm::MotionLimits limits = options.limits;
  limits.outermost_finger_m = 0.5 * (options.effector.fingers.size() - 1) * options.spacing_mm / 1000;
  // Before anything is connected: that the limits make sense.
  TOUCHSTONE_RETURN_IF_ERROR(
      gateway::arm::MotionPlanner::Create(options.arm.model, limits, calibration).status());
  TOUCHSTONE_ASSIGN_OR_RETURN(
      parts.journal, session::Journal::Open(options.journal, session::Journal::Mode::kCreateOrReadWrite));
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.audit, gateway::audit::AuditLog::Open(options.audit_log));

  gateway::arm::UrArmOptions arm;
  arm.model = options.arm.model;
  arm.address = options.arm.address;
  arm.dashboard_port = options.arm.dashboard_port;
  arm.primary_port = options.arm.primary_port;
  arm.secondary_port = options.arm.secondary_port;
  arm.rtde_port = options.arm.rtde_port;
  arm.frozen_after_s = options.arm.silence_s;
  arm.script.flange_from_tip = calibration.flange_from_tip;
  arm.script.payload_kg = options.limits.payload_kg;
  arm.script.payload_cog_m = options.limits.payload_cog_m;
  if (!options.limits.payload_cog_m.has_value())
    spdlog::warn(
        "limits.payload_cog_mm is not given: the arm takes the centre of gravity of its installation "
        "(PolyScope, "
        "Payload) for that of {} kg; make sure that it is right, or give it, or the arm may stop "
        "protectively",
        options.limits.payload_kg);
  arm.script.transit_speed_m_s = options.limits.transit_speed_m_s;
  arm.script.acceleration_m_s2 = options.limits.acceleration_m_s2;
  arm.script.time_scale = options.time_scale;
  arm.script.watchdog_hz = options.arm.watchdog_hz;
  arm.body_limits = limits;
  arm.calibration = calibration;
  TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<gateway::arm::UrArm> connected,
                              gateway::arm::ConnectUrArm(arm, parts.changes.get()));
  // The rig lets go of its planner before its arm.
  TOUCHSTONE_ASSIGN_OR_RETURN(
      parts.planner,
      gateway::arm::MotionPlanner::Create(options.arm.model, limits, calibration,
                                          [ur = connected.get()] { return ur->CalibratedKinematics(); }));
  parts.arm = std::move(connected);
  TOUCHSTONE_ASSIGN_OR_RETURN(parts.effector,
                              gateway::effector::Effector::Open(options.effector, parts.changes.get()));
  if (!options.camera.uri.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(parts.camera, gateway::camera::CameraDevice::Open(options.camera));
    parts.vertical_fov_rad = options.camera.vertical_fov_rad;
    if (!options.camera.intrinsics.empty()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(parts.intrinsics,
                                  gateway::camera::ReadIntrinsics(options.camera.intrinsics));
    }
  }

  gateway::RigOptions rig;
  rig.fingers = static_cast<int>(options.effector.fingers.size());
  rig.spacing_m = options.spacing_mm / 1000;
  rig.time_scale = options.time_scale;
  rig.max_overtravel_m = options.max_overtravel_mm / 1000;
  rig.mount_command = options.mount_command;
  rig.mount_timeout_s = options.mount_timeout_s;
  rig.provenance_note = options.provenance_note;
  rig.emulated = options.emulated;
  rig.effector_port = options.effector.port;
  rig.bounds_of = [&objects](const std::string& name) -> std::optional<geometry::Bounds> {
    const absl::StatusOr<const source::ServedObject*> object = objects.Find(name, "object");
    if (!object.ok()) return std::nullopt;
    return (*object)->surface->bounds();
  };
  rig.camera_tolerance.position_m = options.pose_tolerance_mm / 1000;
  rig.camera_tolerance.angle_rad = options.pose_tolerance_deg * kRadiansPerDegree;
  return gateway::Rig::Create(std::move(rig), std::move(parts));
}

}  // namespace

struct GatewayServer::Parts {
  Resources resources;
  gateway::bundle::Replay replay;     // its files go last; empty: a rig, or a journal, is served
  std::unique_ptr<LeaseBook> leases;  // before the rig, whose audit log asks who holds one
  std::unique_ptr<source::PhysicalSource> source;
  gateway::Rig* rig = nullptr;              // the source's device, if it is one
  source::RecordedRig* replayed = nullptr;  // likewise, of a bug report
  std::unique_ptr<SourceService> source_service;
  std::unique_ptr<ControlService> control;
  std::unique_ptr<RigService> rig_service;
  std::unique_ptr<ReplayRigService> replay_service;
  std::unique_ptr<FreedriveService> freedrive;
  std::unique_ptr<JournalSessionsService> sessions;
  Serving serving;
  std::unique_ptr<StatusPages> pages;  // asks the server
};

GatewayServer::GatewayServer() : parts_(std::make_unique<Parts>()) {}

absl::StatusOr<std::unique_ptr<GatewayServer>> GatewayServer::Start(GatewayOptions options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckServing(options.common));
  TOUCHSTONE_RETURN_IF_ERROR(
      gateway::timing::FollowClock(options.replay.empty() ? options.emulated_clock : ""));
  std::unique_ptr<GatewayServer> gateway(new GatewayServer);
  Parts& parts = *gateway->parts_;
  Resources& resources = parts.resources;
  resources.options = options.common;
  if (!options.common.metrics.empty()) resources.calls = std::make_unique<CallMetrics>();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      resources.access,
      Access::Create(options.common.listen, options.common.access,
                     options.replay.empty() ? Motion::kRig : Motion::kSimulated, *options.common.clock));
  resources.OpenPlaces();
  resources.access->CountRefusals(resources.calls.get());
  resources.pool = std::make_unique<ThreadPool>(0);
  if (gateway::bundle::LooksLikeBundle(options.replay)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(parts.replay, gateway::bundle::OpenReplay(options.replay));
    // A mesh that was named here takes the place of the bundle's.
    std::vector<source::MeshSpec>& meshes = options.common.meshes;
    for (const source::MeshSpec& mesh : parts.replay.meshes)
      if (std::none_of(meshes.begin(), meshes.end(), [&](const auto& own) { return own.name == mesh.name; }))
        meshes.push_back(mesh);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(
      resources.objects, source::ObjectStore::Load(options.common.meshes, options.common.supershape_triangles,
                                                   resources.pool.get()));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.models, ModelStore::Open(""));
  session::Journal* journal = nullptr;
  std::unique_ptr<source::RigDevice> device;
  if (options.replay.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<gateway::Rig> rig, OpenRig(options, resources.objects));
    parts.rig = rig.get();
    journal = &rig->journal();
    device = std::move(rig);
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<source::RecordedRig> recorded,
                                parts.replay.bundle == nullptr
                                    ? source::RecordedRig::Open(options.replay)
                                    : source::RecordedRig::Open(parts.replay.journal, parts.replay.faults));
    if (parts.replay.bundle != nullptr) parts.replayed = recorded.get();
    journal = &recorded->journal();
    device = std::move(recorded);
  }
  const bool moves = device->moves();
  parts.source = std::make_unique<source::PhysicalSource>(&resources.objects, options.common.OfSource(),
                                                          std::move(device), gateway::camera::Rectify);
  parts.leases = std::make_unique<LeaseBook>(options.common.lease_window_s, moves, *options.common.clock);
  if (parts.rig != nullptr)
    parts.rig->audit().NameHolders([leases = parts.leases.get()] { return leases->Holder(); });
  parts.source_service = std::make_unique<SourceService>(&resources, parts.leases.get(), parts.source.get());
  parts.sessions = std::make_unique<JournalSessionsService>(
      &resources, journal, parts.leases.get(), parts.rig == nullptr ? nullptr : &parts.rig->audit());
  std::vector<ServedService> services = {{"touchstone.v1.Source", parts.source_service.get()},
                                         {"touchstone.v1.Sessions", parts.sessions.get()}};
  if (parts.rig != nullptr) {
    parts.control = std::make_unique<RigControlService>(&resources, parts.leases.get(), parts.rig);
    parts.rig_service = std::make_unique<RigService>(&resources, parts.leases.get(), parts.rig);
    services.push_back({"touchstone.v1.Rig", parts.rig_service.get()});
    parts.freedrive = std::make_unique<FreedriveService>(&resources, parts.leases.get(), parts.rig);
    services.push_back({"touchstone.v1.Freedrive", parts.freedrive.get()});
  } else if (parts.replayed != nullptr) {
    parts.control = std::make_unique<ReplayControlService>(&resources, parts.leases.get(), parts.replay);
    parts.replay_service =
        std::make_unique<ReplayRigService>(&resources, parts.leases.get(), parts.replay, parts.replayed);
    services.push_back({"touchstone.v1.Rig", parts.replay_service.get()});
  } else {
    parts.control = std::make_unique<ControlService>(&resources, parts.leases.get());
  }
  services.push_back({"touchstone.v1.Control", parts.control.get()});
  for (const ServedService& service : services)
    GuardRequests(service.service, &resources.options, resources.memory.get(), resources.rate.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(Serving serving, StartServing(options.common, services, parts.control.get(),
                                                            resources.access.get(), resources.calls.get()));
  resources.memory->Begin();
  parts.serving = std::move(serving);
  if (!options.common.metrics.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(parts.pages, StatusPages::Start(options.common.metrics, &resources,
                                                                parts.serving.server->InProcessChannel({})));
  }
  return gateway;
}

GatewayServer::~GatewayServer() {
  parts_->pages.reset();
  if (parts_->rig != nullptr) parts_->rig->Close();
  parts_->resources.draining = true;
  parts_->serving.End();
}

int GatewayServer::port() const {
  return parts_->serving.port;
}

source::RigDevice& GatewayServer::device() {
  return parts_->source->device();
}

void GatewayServer::Drain() {
  // What moves is stopped, and latches: whoever asks the next gateway moves nothing before a person has looked.
  if (parts_->rig != nullptr) parts_->rig->Close();
  parts_->resources.draining = true;
  if (parts_->pages != nullptr) parts_->pages->StopAsking();
  if (parts_->serving.acceptor != nullptr) parts_->serving.acceptor->End();
  StopServing(parts_->resources.options, parts_->serving.server.get());
}

}  // namespace touchstone::service
