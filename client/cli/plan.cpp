// touchstone plan: the commanded touches of a plan, without touching anything.
#include "client/cli/plan_options.h"
#include "client/source/lab_units.h"
#include "client/source/measurement_csv.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

struct PlanCommandOptions {
  PlanOptions plan;
  std::vector<std::string> objects;
  uint64_t seed = 0;
  uint64_t first = 0;
  uint32_t count = 10;
  std::string output;
};

// Touches that one request asks for.
constexpr uint32_t kTouchesPerRequest = 10000;

absl::Status RunPlan(const Cli& cli, const PlanCommandOptions& options, bool count_given) {
  v1::ExpandPlanRequest request;
  TOUCHSTONE_ASSIGN_OR_RETURN(*request.mutable_plan(), MakePlan(options.plan, nullptr));
  request.set_seed(options.seed);
  // A plan that ends is written whole unless a part was asked for.
  uint64_t count = options.count;
  if (!count_given && request.plan().has_faces())
    count = uint64_t{6} * request.plan().faces().samples_per_face() * request.plan().faces().rounds();
  if (!count_given && request.plan().has_list()) count = request.plan().list().touches_size();
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());

  std::vector<client::MeasuredTouch> touches;
  for (const std::string& object : SplitCommas(options.objects)) {
    request.set_object(object);
    for (uint64_t done = 0; done < count;) {
      const uint32_t step = static_cast<uint32_t>(std::min<uint64_t>(count - done, kTouchesPerRequest));
      request.set_first_index(options.first + done);
      request.set_count(step);
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const v1::ExpandPlanResponse response,
          client::Connection::Call(&v1::Source::Stub::ExpandPlan, connection->source(), request));
      for (const v1::CommandedTouch& touch : response.touches()) {
        client::MeasuredTouch row;
        row.touch = options.first + touches.size();
        row.object = object;
        row.commanded = touch;
        touches.push_back(std::move(row));
      }
      if (response.touches_size() == 0) break;  // the plan has ended
      done += step;
    }
  }
  const std::string details = absl::StrCat(" (", Counted(touches.size(), "touch", "touches"), ")");
  if (!cli.output().json) {
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, client::FormatMeasurements(touches)));
    cli.LogWritten(options.output, details);
    return absl::OkStatus();
  }

  Json list = Json::array();
  for (const client::MeasuredTouch& touch : touches) {
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
    list.push_back(std::move(item));
  }
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, Json({{"touches", list}}).dump(2) + "\n"));
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
  cli->AddFormattedOutput(command, "-o,--output", &options->output, "The file to write. Default: stdout");
  AddPlanOptions(cli, command, &options->plan);
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
