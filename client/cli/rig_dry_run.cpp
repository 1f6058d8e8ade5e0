// touchstone rig dry-run: every check of every touch, without motion.
#include <algorithm>
#include <numeric>

#include "client/cli/plan_options.h"
#include "client/cli/rig.h"
#include "client/report/path_drawing.h"
#include "client/source/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text.h"

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
                    {"up_face", row.up_face},
                    {"duration_s", row.duration_s}});
  return list;
}

Eigen::Vector3d VectorOf(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

std::string Drawing(const DryRunOptions& options, const v1::RigState& state,
                    const std::vector<PlannedRow>& rows, const std::vector<v1::TouchCheck>& checks) {
  client::PathDrawing drawing;
  drawing.title =
      absl::StrCat(options.plan, " on ", state.arm().model(), ": ", Counted(rows.size(), "touch", "touches"));
  for (size_t k = 0; k < rows.size(); ++k) {
    client::DrawnTouch touch;
    touch.number = static_cast<int>(rows[k].touch.touch);
    touch.possible = rows[k].possible;
    touch.reason = rows[k].reason;
    touch.transit_poses = checks[k].transit_poses();
    for (const v1::BasePose& pose : checks[k].path()) touch.path.push_back(VectorOf(pose.position_m()));
    // The target lies on the approach, a standoff from its start.
    const size_t start = touch.transit_poses;
    if (start > 0 && start < touch.path.size()) {
      const Eigen::Vector3d stroke = touch.path.back() - touch.path[start - 1];
      if (stroke.norm() > 0)
        touch.target_m = touch.path[start - 1] + stroke.normalized() * rows[k].touch.commanded.standoff_m();
    }
    drawing.touches.push_back(std::move(touch));
  }
  return client::DrawPaths(drawing);
}

absl::Status RunDryRun(const Cli& cli, const DryRunOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<client::MeasuredTouch> plan, ReadTouches(options.plan));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<PlannedRow> rows,
                              RowsOf(plan, client::SessionNameOf(options.plan), options.plan));
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
  std::vector<size_t> all(rows.size());
  std::iota(all.begin(), all.end(), size_t{0});
  std::vector<v1::TouchCheck> checks;
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRows(rig.connection.get(), all, &rows, options.drawing.empty() ? nullptr : &checks));

  if (!options.drawing.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.drawing, Drawing(options, state, rows, checks)));
    cli.LogWritten(options.drawing);
  }
  const size_t possible =
      std::count_if(rows.begin(), rows.end(), [](const PlannedRow& row) { return row.possible; });
  const std::vector<RigGroup> groups = GroupRows(
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
      "touchstone rig dry-run plan.csv -o path.svg --server 127.0.0.1:50052      also draws the "
      "path of the tip",
      [cli, options] { return RunDryRun(*cli, *options); });
  cli->AddInput(
      command,
      command->add_option("PLAN", options->plan, "A CSV file of touches (touchstone plan writes one)")
          ->type_name("")
          ->required());
  cli->AddOutput(command, "-o,--output", &options->drawing,
                 "Draw the path of the tip, from above and from the side (SVG)");
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
