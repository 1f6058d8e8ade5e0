// touchstone rig dry-run: every check of every touch, without motion.
#include <algorithm>
#include <numeric>

#include "client/cli/options/plan_options.h"
#include "client/cli/rig/rig.h"
#include "client/report/path_drawing.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/pose.h"
#include "server/session/recorded/base_pose.h"

namespace touchstone::cli {
namespace {

constexpr size_t kMaxPathsShown = 40;

struct DryRunOptions {
  std::string plan, drawing;
};

Json RowsJson(const std::vector<PlannedRow>& rows) {
  Json list = Json::array();
  for (const PlannedRow& row : rows)
    list.push_back({{"touch", row.touch.touch},
                    {"object", row.touch.object},
                    {"possible", row.possible},
                    {"reason", row.reason},
                    {"notes", row.notes},
                    {"up_face", row.up_face},
                    {"duration_s", row.duration_s}});
  return list;
}

Eigen::Vector3d VectorOf(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

Eigen::Isometry3d PosedBy(const v1::BasePose& pose) {
  return geometry::PoseFromVector(session::ParseBasePose(pose));
}

std::vector<Eigen::Vector3d> PointsOf(const google::protobuf::RepeatedPtrField<v1::Vector3>& points) {
  std::vector<Eigen::Vector3d> list;
  for (const v1::Vector3& point : points) list.push_back(VectorOf(point));
  return list;
}

client::DrawnTouch DrawnOf(const PlannedRow& row, const v1::TouchCheck& check) {
  client::DrawnTouch touch;
  touch.number = static_cast<int>(row.touch.touch);
  touch.possible = row.possible;
  touch.reason = row.reason;
  touch.notes = row.notes;
  touch.transit_poses = check.transit_poses();
  for (const v1::BasePose& pose : check.path()) touch.path.push_back(VectorOf(pose.position_m()));
  touch.start.links = PointsOf(check.start_posture().links_m());
  touch.start.tips = PointsOf(check.start_posture().tips_m());
  if (check.start_posture().has_camera_m()) touch.start.camera = VectorOf(check.start_posture().camera_m());
  if (check.has_base_from_object())
    touch.target_m = PosedBy(check.base_from_object()) * VectorOf(row.touch.commanded.target_m());
  return touch;
}

std::string Drawing(const DryRunOptions& options, const v1::RigState& state,
                    const std::vector<PlannedRow>& rows, const std::vector<v1::TouchCheck>& checks) {
  client::PathDrawing drawing;
  drawing.title =
      absl::StrCat(options.plan, " on ", state.arm().model(), ": ", Counted(rows.size(), "touch", "touches"));
  if (state.has_limits())
    drawing.limits = {VectorOf(state.limits().box_min_m()), VectorOf(state.limits().box_max_m())};
  for (size_t k = 0; k < rows.size(); ++k) {
    const std::string title = absl::StrCat(rows[k].touch.object, " with its face ", rows[k].up_face, " up");
    auto face = std::find_if(drawing.faces.begin(), drawing.faces.end(),
                             [&](const client::DrawnFace& other) { return other.title == title; });
    if (face == drawing.faces.end()) {
      drawing.faces.emplace_back();
      face = drawing.faces.end() - 1;
      face->title = title;
      if (checks[k].has_base_from_object()) {
        const Eigen::Vector3d least = VectorOf(checks[k].object_min_m()),
                              most = VectorOf(checks[k].object_max_m());
        face->object.emplace();
        for (size_t corner = 0; corner < 8; ++corner)
          (*face->object)[corner] =
              PosedBy(checks[k].base_from_object()) * Eigen::Vector3d(corner & 1 ? most.x() : least.x(),
                                                                      corner & 2 ? most.y() : least.y(),
                                                                      corner & 4 ? most.z() : least.z());
      }
    }
    face->touches.push_back(DrawnOf(rows[k], checks[k]));
  }
  return client::DrawPaths(drawing);
}

// "Touch 3: the approach comes near ...", the first of them.
std::string NotesText(const std::vector<PlannedRow>& rows) {
  std::string text;
  size_t count = 0;
  for (const PlannedRow& row : rows)
    for (const std::string& note : row.notes)
      if (++count <= kMaxPathsShown) absl::StrAppend(&text, "Touch ", row.touch.touch, ": ", note, ".\n");
  if (count > kMaxPathsShown) absl::StrAppend(&text, "... and ", count - kMaxPathsShown, " more notes.\n");
  return text;
}

absl::Status RunDryRun(const Cli& cli, const DryRunOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<client::MeasuredTouch> plan, ReadTouches(options.plan));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<PlannedRow> rows,
                              client::RowsOf(plan, client::SessionNameOf(options.plan), options.plan));
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
  std::vector<size_t> all(rows.size());
  std::iota(all.begin(), all.end(), size_t{0});
  std::vector<v1::TouchCheck> checks;
  TOUCHSTONE_RETURN_IF_ERROR(CheckRows(rig.connection.get(), all, &rows,
                                       options.drawing.empty() ? nullptr : &checks,
                                       [] { return !Interrupt::Raised(); }));

  if (!options.drawing.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.drawing, Drawing(options, state, rows, checks)));
    cli.LogWritten(options.drawing);
  }
  const size_t possible =
      std::count_if(rows.begin(), rows.end(), [](const PlannedRow& row) { return row.possible; });
  const std::vector<RigGroup> groups = client::GroupRows(
      rows, [&](size_t row) { return rows[row].possible; }, state.object(),
      client::UpFaceWord(state.up_face()));
  double duration_s = 0;
  for (const RigGroup& group : groups) duration_s += group.duration_s;
  if (cli.output().json) {
    Json list = Json::array();
    for (const RigGroup& group : groups)
      list.push_back({{"object", group.object},
                      {"up_face", group.up_face},
                      {"touches", group.rows.size()},
                      {"duration_s", group.duration_s}});
    PrintJson({{"touches", rows.size()},
               {"possible", possible},
               {"duration_s", duration_s},
               {"groups", list},
               {"checks", RowsJson(rows)}});
  } else {
    std::string text = ImpossibleTable(rows, kMaxPathsShown);
    if (!text.empty()) text += "\n";
    if (const std::string notes = NotesText(rows); !notes.empty()) absl::StrAppend(&text, notes, "\n");
    Table table({"OBJECT", "FACE UP", "TOUCHES", "TIME"});
    for (const RigGroup& group : groups)
      table.Add({group.object, group.up_face, std::to_string(group.rows.size()),
                 DurationInWords(group.duration_s)});
    if (!groups.empty()) text += table.Text() + "\n";
    absl::StrAppend(&text, possible, " of ", Counted(rows.size(), "touch", "touches"), " possible, ",
                    DurationInWords(duration_s), " of motion, the object is put ",
                    Counted(groups.size(), "time", "times"), ". Nothing was moved.\n");
    TOUCHSTONE_RETURN_IF_ERROR(cli.Print(text));
  }
  if (possible == rows.size()) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(options.plan, ": ", rows.size() - possible, " of ",
                                                    rows.size(), " touches are impossible here"));
}

}  // namespace

void AddRigDryRun(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<DryRunOptions>();
  CLI::App* command = cli->AddCommand(
      group, "dry-run",
      "Checks every touch of a plan as a run would, without motion. Exit code 4 if any is impossible.",
      "touchstone rig dry-run plan.csv --server 127.0.0.1:50052\n"
      "touchstone rig dry-run plan.csv -o path.svg --server 127.0.0.1:50052      also draws them",
      [cli, options] { return RunDryRun(*cli, *options); });
  cli->AddInput(
      command,
      command->add_option("PLAN", options->plan, "A CSV file of touches (touchstone plan writes one)")
          ->type_name("")
          ->required());
  cli->AddOutput(
      command, "-o,--output", &options->drawing,
      "Draw touches, object, arm, camera and limits in space, one row per face that points up (SVG)");
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
