// touchstone rig calibrate: finger offsets and noise from a flat face, the tip from a pivot.
#include <chrono>
#include <cmath>
#include <ctime>

#include "client/cli/common/progress_bar.h"
#include "client/cli/common/terminal.h"
#include "client/cli/rig/calibrate.h"
#include "client/cli/session/journal_session.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/flat_calibration.h"
#include "server/gateway/calibration/tool_calibration.h"
#include "server/geometry/pose.h"
#include "server/model/model.h"
#include "server/session/recorded/base_pose.h"

namespace touchstone::cli {
namespace {

constexpr double kStraight = 0.9999;  // an approach along an axis of the object, within about a degree
constexpr double kStandoffM = 0.03;
constexpr int kMaxTouches = 10000;

struct FlatTouches {
  std::vector<gateway::calibration::FlatTouch> touches;
  double spacing_m = 0;
};

// Repeated touches straight onto the middle of the upper face.
absl::StatusOr<FlatTouches> TouchFlat(const Cli& cli, const CalibrateOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Object object, FindObject(rig.connection.get(), options.object));
  const v1::Vector3 &low = object.bounds_min_m(), &high = object.bounds_max_m();
  v1::CommandedTouch touch;
  touch.mutable_target_m()->set_x((low.x() + high.x()) / 2);
  touch.mutable_target_m()->set_y((low.y() + high.y()) / 2);
  touch.mutable_target_m()->set_z(high.z());
  touch.mutable_approach()->set_z(-1);
  touch.mutable_lateral()->set_x(1);
  touch.set_standoff_m(kStandoffM);
  touch.set_speed_m_s(options.speed_mm_s / kMillimetresPerMetre);

  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const auto source, OpenLeased(cli, rig.connection.get(), options.motion, [&](const std::string& line) {
        bar.Clear();
        cli.Log(line);
      }));
  const StopOnInterrupt stop_on_interrupt(source.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
  TOUCHSTONE_RETURN_IF_ERROR(MountForTouches(cli, source.get(), state, options.object, "+z"));
  FlatTouches flat;
  flat.spacing_m = state.spacing_m();
  for (int k = 0; k < options.touches; ++k) {
    bar.ShowStage(absl::StrCat("touch ", k + 1, " of ", options.touches),
                  static_cast<double>(k) / options.touches);
    v1::TouchRequest request;
    request.set_object(options.object);
    request.set_session(options.motion.session.empty() ? "calibration" : options.motion.session);
    *request.add_touches() = touch;
    request.add_touch_ids(client::NewTouchId(k));
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchResponse response, source->Touch(std::move(request)));
    const v1::TouchResult& result = response.results(0);
    const double measured_m_s = result.measured().speed_m_s();
    flat.touches.push_back({measured_m_s > 0 ? measured_m_s : touch.speed_m_s(),
                            {result.contact_time_s().begin(), result.contact_time_s().end()}});
  }
  bar.Clear();
  return flat;
}

// Those of a recorded session that came straight onto a face.
absl::StatusOr<FlatTouches> RecordedFlat(const CalibrateOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(options.from));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalSession session,
                              FindSession(*journal, options.from, options.motion.session, "--session NAME"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<client::MeasuredTouch> recorded,
                              TouchesOf(*journal, session.name));
  FlatTouches flat;
  flat.spacing_m = session.spacing_m;
  for (const client::MeasuredTouch& touch : recorded) {
    const v1::Vector3& a = touch.commanded.approach();
    if (!options.object.empty() && touch.object != options.object) continue;
    if (std::max({std::abs(a.x()), std::abs(a.y()), std::abs(a.z())}) < kStraight) continue;
    flat.touches.push_back({touch.commanded.speed_m_s(), touch.time_s});
  }
  if (flat.touches.empty())
    return absl::FailedPreconditionError(absl::StrCat(options.from, ": session '", session.name,
                                                      "' has no touch straight onto a face",
                                                      options.object.empty() ? "" : " of " + options.object));
  return flat;
}

absl::Status RunFlat(const Cli& cli, const CalibrateOptions& options) {
  FlatTouches flat;
  if (options.from.empty()) {
    if (options.object.empty())
      return absl::InvalidArgumentError("OBJECT is missing: whose upper face is flat?");
    TOUCHSTONE_ASSIGN_OR_RETURN(flat, TouchFlat(cli, options));
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(flat, RecordedFlat(options));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const gateway::calibration::FlatCalibration fit,
      gateway::calibration::CalibrateFlat(
          flat.touches, options.spacing_mm > 0 ? options.spacing_mm / kMillimetresPerMetre : flat.spacing_m));
  model::Model base = model::NominalModel(fit.fingers, fit.spacing_m);
  base.name = client::SessionNameOf(options.output);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string model,
                              gateway::calibration::CalibratedModelFile(base, fit, effects::Catalogue()));
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, model));
  if (cli.output().json) {
    Json offset_mm = Json::array(), error_mm = Json::array();
    for (int finger = 0; finger < fit.fingers; ++finger) {
      offset_mm.push_back(fit.offset_m[finger] * kMillimetresPerMetre);
      error_mm.push_back(fit.offset_std_error_m[finger] * kMillimetresPerMetre);
    }
    PrintJson({{"model", options.output},
               {"touches", fit.touches},
               {"left_out", fit.left_out},
               {"offset_mm", offset_mm},
               {"offset_std_error_mm", error_mm},
               {"sigma_us", fit.sigma_s * kMicrosecondsPerSecond},
               {"sigma_std_error_us", fit.sigma_std_error_s * kMicrosecondsPerSecond},
               {"note", fit.note}});
  }
  cli.Log(absl::StrCat(options.output, ": from ", Counted(fit.touches, "touch", "touches"),
                       fit.left_out > 0 ? absl::StrCat(", ", fit.left_out, " left out") : ""));
  for (int finger = 0; finger < fit.fingers; ++finger)
    cli.Log(absl::StrCat("  finger ", finger, "  offset ",
                         Rounded(fit.offset_m[finger] * kMillimetresPerMetre), " +- ",
                         Rounded(fit.offset_std_error_m[finger] * kMillimetresPerMetre), " mm"));
  cli.Log(absl::StrCat("  noise     ", Rounded(fit.sigma_s * kMicrosecondsPerSecond), " +- ",
                       Rounded(fit.sigma_std_error_s * kMicrosecondsPerSecond), " us"));
  if (!fit.note.empty()) cli.Log(Wrap(fit.note, TextWidth(), 0));
  return absl::OkStatus();
}

absl::Status RunTip(const Cli& cli, const CalibrateOptions& options) {
  if (options.calibration.empty())
    return absl::InvalidArgumentError("--calibration is missing: the file that the gateway runs with now");
  if (options.poses < 4 || options.poses > 100)
    return absl::InvalidArgumentError(absl::StrCat("--poses: ", options.poses, " is out of range; 4 to 100"));
  TOUCHSTONE_ASSIGN_OR_RETURN(gateway::calibration::Calibration calibration,
                              gateway::calibration::ReadCalibration(options.calibration));
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  cli.Log(
      "Fix a sharp point in the rig's reach. Guide the tool by hand (free drive) so that the middle finger's "
      "tip rests on it, every time tilted another way by 20 deg and more.");
  std::vector<Eigen::Isometry3d> base_from_flange;
  for (int k = 0; k < options.poses; ++k) {
    TOUCHSTONE_RETURN_IF_ERROR(
        AskPerson(absl::StrCat("Pose ", k + 1, " of ", options.poses, ": tip on the point")));
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
    if (!state.arm().connected())
      return absl::UnavailableError("the arm is not connected, so it is unknown where the tool is");
    base_from_flange.push_back(PoseOf(state.arm().base_from_tip()) * calibration.flange_from_tip.inverse());
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const gateway::calibration::ToolCalibration fit,
                              gateway::calibration::CalibrateTool(base_from_flange));
  const Eigen::Vector3d before_m = calibration.flange_from_tip.translation();
  calibration.flange_from_tip.translation() = fit.flange_from_tip_m;
  calibration.notes["date"] = Today();
  calibration.notes["how"] = absl::StrCat("tip from a pivot in ", options.poses, " poses");
  calibration.notes["rms_mm tip"] = Rounded(fit.rms_m * kMillimetresPerMetre);
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, gateway::calibration::FormatCalibration(calibration)));
  if (cli.output().json) {
    const Eigen::Vector3d mm = fit.flange_from_tip_m * kMillimetresPerMetre,
                          error_mm = fit.flange_from_tip_std_error_m * kMillimetresPerMetre;
    PrintJson({{"calibration", options.output},
               {"flange_from_tip_mm", {mm.x(), mm.y(), mm.z()}},
               {"std_error_mm", {error_mm.x(), error_mm.y(), error_mm.z()}},
               {"rms_mm", fit.rms_m * kMillimetresPerMetre}});
  }
  cli.Log(absl::StrCat(options.output, ": tip at ", InMillimetres(fit.flange_from_tip_m),
                       " mm of the flange (it was ", InMillimetres(before_m), "), standard errors ",
                       InMillimetres(fit.flange_from_tip_std_error_m), " mm; it moved about its point by ",
                       Rounded(fit.rms_m * kMillimetresPerMetre), " mm (rms); pose ", fit.worst + 1,
                       " fits worst, ", Rounded(fit.worst_m * kMillimetresPerMetre), " mm"));
  cli.Log("the gateway takes it when it is started with this file");
  return absl::OkStatus();
}

absl::Status RunCalibrate(const Cli& cli, const CalibrateOptions& options) {
  if (!(options.speed_mm_s > 0))
    return absl::InvalidArgumentError(absl::StrCat("--speed-mm-s: ", options.speed_mm_s, " is not above 0"));
  if (!(options.spacing_mm >= 0))
    return absl::InvalidArgumentError(absl::StrCat("--spacing-mm: ", options.spacing_mm, " is below 0"));
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("KIND", options.kind, {"flat", "object", "tip"}).status());
  if (options.touches < 2 || options.touches > kMaxTouches)
    return absl::InvalidArgumentError(
        absl::StrCat("--touches: ", options.touches, " is out of range; 2 to ", kMaxTouches));
  if (options.kind == "object") return RunCalibrateObject(cli, options);
  return options.kind == "tip" ? RunTip(cli, options) : RunFlat(cli, options);
}

}  // namespace

std::string Today() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  char text[16] = "";
  if (::gmtime_r(&now, &parts) != nullptr) std::strftime(text, sizeof text, "%Y-%m-%d", &parts);
  return text;
}

Eigen::Isometry3d PoseOf(const v1::BasePose& pose) {
  return geometry::PoseFromVector(session::ParseBasePose(pose));
}

std::string InMillimetres(const Eigen::Vector3d& metres) {
  return absl::StrCat(Rounded(metres.x() * kMillimetresPerMetre), ", ",
                      Rounded(metres.y() * kMillimetresPerMetre), ", ",
                      Rounded(metres.z() * kMillimetresPerMetre));
}

absl::StatusOr<v1::Object> FindObject(client::Connection* connection, const std::string& name) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse objects,
                              connection->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  std::vector<std::string> names;
  for (const v1::Object& object : objects.objects()) {
    if (object.name() == name) return object;
    names.push_back(object.name());
  }
  return OneOf("OBJECT", name, names).status();
}

void AddRigCalibrate(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<CalibrateOptions>();
  CLI::App* command = cli->AddCommand(
      group, "calibrate",
      "Measures the rig itself: the fingers' offsets and noise on a flat face (a model file), or where the "
      "tip is, or where an object lies (a calibration file). What it reads is never changed.",
      "touchstone rig calibrate flat plate --touches 20 -o model.yaml --server 127.0.0.1:50052\n"
      "touchstone rig calibrate flat --from session.db -o model.yaml       from touches that were recorded\n"
      "touchstone rig calibrate object lat20 --calibration calibration.yaml -o new.yaml --server "
      "127.0.0.1:50052\n"
      "touchstone rig calibrate tip --calibration calibration.yaml -o new.yaml --server 127.0.0.1:50052",
      [cli, options] { return RunCalibrate(*cli, *options); });
  command->add_option("KIND", options->kind, "flat, object or tip. Default: flat")->type_name("");
  command
      ->add_option("OBJECT", options->object,
                   "flat: the object whose upper face is flat; object: the one that lies there")
      ->type_name("");
  cli->AddOutput(command, "-o,--output", &options->output, "The model or calibration file to write")
      ->required();
  command->add_option("--touches", options->touches, "flat, object: how many. Default: 20")->type_name("N");
  command->add_option("--speed-mm-s", options->speed_mm_s, "flat, object: speed of the approach. Default: 20")
      ->type_name("V");
  command
      ->add_option("--spacing-mm", options->spacing_mm,
                   "flat, object: between neighbouring fingers. Default: the rig's own, or the session's")
      ->type_name("MM");
  const auto add_input = [&](const std::string& name, std::string& value, const std::string& text) {
    cli->AddInput(command, command->add_option(name, value, text)->type_name("FILE"));
  };
  add_input("--from", options->from,
            "flat: take the touches straight onto a face of a session that this journal (.db) has");
  add_input("--calibration", options->calibration, "object, tip: the file that the gateway runs with");
  add_input("--surface", options->surface, "object: its mesh file. Default: the built-in shape of that name");
  command->add_option("--poses", options->poses, "tip: in how many orientations. Default: 6")->type_name("N");
  AddMotionOptions(command, &options->motion, true);
  command->get_option("--session")
      ->description(
          "flat: the session that journals the touches, or the one of --from. Default: calibration");
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
