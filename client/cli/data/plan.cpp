// touchstone plan: the commanded touches of a plan, without touching anything.
#include "client/cli/common/progress_bar.h"
#include "client/cli/options/plan_options.h"
#include "client/source/dataset/lab_units.h"
#include "client/source/plans/plan_expansion.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

struct PlanCommandOptions {
  PlanOptions plan;
  std::vector<std::string> objects;
  uint64_t seed = 0;
  uint64_t first = 0;
  uint32_t count = 10;
  uint32_t max_draws = 0;
  std::string model;
  std::string output;
};

// Why draws were rejected, by the names that JSON has, and in words.
struct Rejection {
  const char *name, *words;
  uint64_t count;
};
std::vector<Rejection> RejectionsOf(const v1::PlanDraws& draws) {
  return {{"no_surface", "the line met no surface", draws.no_surface()},
          {"start_blocked", "a finger started inside of the object or behind a part of it",
           draws.start_blocked()},
          {"finger_missed", "a finger met nothing", draws.finger_missed()},
          {"beyond_stroke", "a finger met the object only beyond the stroke", draws.beyond_stroke()},
          {"steep_incidence", "a finger met the surface too obliquely", draws.steep_incidence()}};
}

// How many draws the touches took, and what is odd about them.
void LogDraws(const Cli& cli, const client::PlannedTouches& planned) {
  for (const std::string& note : planned.notes) cli.Log("note: " + note);
  for (const auto& [object, draws] : planned.draws) {
    uint64_t rejected = 0;
    std::string why;
    for (const Rejection& rejection : RejectionsOf(draws)) {
      rejected += rejection.count;
      if (rejection.count > 0)
        absl::StrAppend(&why, why.empty() ? ": in " : ", in ", rejection.count, " ", rejection.words);
    }
    cli.Log(absl::StrCat(object, ": ", Counted(draws.draws() - rejected, "touch", "touches"), " took ",
                         Counted(draws.draws(), "draw", "draws"), why));
  }
}

Json DrawsJson(const client::PlannedTouches& planned) {
  Json json = Json::object();
  for (const auto& [object, draws] : planned.draws) {
    Json& item = json[object] = {{"draws", draws.draws()}};
    for (const Rejection& rejection : RejectionsOf(draws)) item[rejection.name] = rejection.count;
  }
  return json;
}

Json TouchJson(const client::MeasuredTouch& touch) {
  const auto vector = [](const v1::Vector3& v, Unit unit) {
    return Json{client::LabNumber(unit, v.x()), client::LabNumber(unit, v.y()),
                client::LabNumber(unit, v.z())};
  };
  const v1::CommandedTouch& c = touch.commanded;
  Json item = {{"touch", touch.touch},
               {"object", touch.object},
               {"speed_mm_s", client::LabNumber(Unit::kMillimetrePerSecond, c.speed_m_s())},
               {"standoff_mm", client::LabNumber(Unit::kMillimetre, c.standoff_m())},
               {"target_mm", vector(c.target_m(), Unit::kMillimetre)},
               {"approach", vector(c.approach(), Unit::kNone)},
               {"lateral", vector(c.lateral(), Unit::kNone)}};
  if (c.has_session_time_s()) item["session_time_s"] = c.session_time_s();
  return item;
}

absl::Status RunPlan(const Cli& cli, const PlanCommandOptions& options, bool count_given) {
  v1::ExpandPlanRequest request;
  TOUCHSTONE_ASSIGN_OR_RETURN(*request.mutable_plan(), MakePlan(options.plan, nullptr));
  request.set_seed(options.seed);
  request.set_max_draws(options.max_draws);
  if (!options.model.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(*request.mutable_model(), ParseModelRef(options.model));
  }
  // A plan that ends is written whole unless a part was asked for.
  uint64_t count = options.count;
  if (!count_given && request.plan().has_faces())
    count = uint64_t{6} * request.plan().faces().samples_per_face() * request.plan().faces().rounds();
  if (!count_given && request.plan().has_list()) count = request.plan().list().touches_size();
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const client::PlannedTouches planned,
      client::ExpandPlan(connection.get(), SplitCommas(options.objects), options.first, count,
                         std::move(request),
                         [&bar](uint64_t done, uint64_t total) { bar.Show(done, total, done, "touches"); }));
  bar.Clear();
  LogDraws(cli, planned);
  const std::string details = absl::StrCat(" (", Counted(planned.touches.size(), "touch", "touches"), ")");
  if (!cli.output().json) {
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, client::FormatMeasurements(planned.touches)));
    cli.LogWritten(options.output, details);
    return absl::OkStatus();
  }
  Json list = Json::array();
  for (const client::MeasuredTouch& touch : planned.touches) list.push_back(TouchJson(touch));
  Json json = {{"touches", list}, {"draws", DrawsJson(planned)}, {"notes", planned.notes}};
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, json.dump(2) + "\n"));
  cli.LogWritten(options.output, details);
  return absl::OkStatus();
}

}  // namespace

void AddPlan(Cli* cli) {
  auto options = std::make_shared<PlanCommandOptions>();
  auto count = std::make_shared<CLI::Option*>(nullptr);
  CLI::App* command = cli->AddCommand(
      nullptr, "plan", "Writes the commanded touches of a plan as CSV, a measurement file without times.",
      "touchstone plan lat20 --count 100 -o plan.csv\n"
      "touchstone plan lat00,lat10,lat20 --plan faces --samples-per-face 8 --rounds 4 -o plan.csv\n"
      "touchstone plan arm --mesh arm=arm.stl --plan faces --model tips.yaml --max-incidence-deg 45 -o "
      "plan.csv\n"
      "touchstone plan lat20 --step-angle-deg 5 --seed 7 --json",
      [cli, options, count] { return RunPlan(*cli, *options, (*count)->count() > 0); });
  command
      ->add_option("OBJECT", options->objects,
                   "The object that is touched, or several: a,b,c (touchstone objects lists them)")
      ->type_name("")
      ->required();
  *count = command->add_option("-n,--count", options->count,
                               "Touches to write. Default: 10, or the whole of --plan faces");
  (*count)->type_name("N");
  command->add_option("--first", options->first, "Number of the first one. Default: 0")->type_name("N");
  command->add_option("--seed", options->seed, "Seed of the directions. Default: 0")->type_name("N");
  cli->AddInput(
      command,
      command
          ->add_option("--model", options->model,
                       "What the real rig has: a model file, name or hash, whose fingers, with its effects, "
                       "must all meet the object. Default: the source's own")
          ->type_name("MODEL"));
  command
      ->add_option("--max-draws", options->max_draws,
                   "Draws for one touch before the object is refused, with the reason. Default: 1000")
      ->type_name("N");
  cli->AddFormattedOutput(command, "-o,--output", &options->output, "The file to write. Default: stdout");
  AddPlanOptions(cli, command, &options->plan);
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
