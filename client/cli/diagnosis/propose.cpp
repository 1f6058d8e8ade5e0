// touchstone propose: what to touch, or to photograph, next, to tell the explanations apart that are left.
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <map>
#include <optional>

#include "client/cli/diagnosis/comparison.h"
#include "client/cli/diagnosis/proposed_touches.h"
#include "client/report/words/words.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/session/images/images_csv.h"

namespace touchstone::cli {
namespace {

struct ProposeOptions : ComparisonOptions {
  // Not given: as many as the source proposes by itself, of the kind that the set has.
  std::optional<uint32_t> touches, photographs;
  std::string output;
};

// A name that says from where: the same view has the same name in every plan, so that a folder keeps those of several.
std::string PictureName(const v1::NextMeasurement& next) {
  const v1::Vector3& eye = next.photograph().eye_m();
  return absl::StrFormat("%s_from_%.0f_%.0f_%.0f.png", next.object(), FromSi(Unit::kMillimetre, eye.x()),
                         FromSi(Unit::kMillimetre, eye.y()), FromSi(Unit::kMillimetre, eye.z()));
}

// Proposed pictures as the images.csv that they would have; empty without any.
std::string PlanOfPhotographs(const v1::Report& report) {
  session::ImageSet plan;
  for (const v1::NextMeasurement& next : report.next()) {
    const v1::CameraPose& camera = next.photograph();
    session::PhotographRow row;
    row.image = plan.photographs.size();
    row.file = PictureName(next);
    for (const session::PhotographRow& other : plan.photographs)
      if (other.file == row.file) row.file = absl::StrFormat("%d_%s", row.image, PictureName(next));
    const auto found = std::find(plan.objects.begin(), plan.objects.end(), next.object());
    row.object = static_cast<int>(found - plan.objects.begin());
    if (found == plan.objects.end()) plan.objects.push_back(next.object());
    const auto vector = [](const v1::Vector3& v) { return Eigen::Vector3d(v.x(), v.y(), v.z()); };
    row.commanded = {vector(camera.eye_m()), vector(camera.at_m()), vector(camera.up())};
    plan.photographs.push_back(std::move(row));
  }
  return session::FormatImagesCsv(plan);
}

// How a plan of one kind is told and written.
struct PlanKind {
  const char *one, *many;
  std::string (*format)(const v1::Report& report);
};

// A limit of the source is on a field of the request; the user typed an option.
absl::Status InOptions(const absl::Status& status) {
  for (const auto& [field, option] :
       {std::pair{"touches = ", "--touches: "}, {"photographs = ", "--photographs: "}})
    if (absl::string_view text = status.message(); absl::ConsumePrefix(&text, field))
      return absl::InvalidArgumentError(absl::StrCat(option, text));
  return status;
}

absl::Status WritePlan(const Cli& cli, const ProposeOptions& options, const PlanKind& kind,
                       const v1::Report& report) {
  std::map<std::string, int> purposes;
  for (const v1::NextMeasurement& next : report.next()) ++purposes[next.purpose()];
  for (const auto& [purpose, count] : purposes)
    cli.Log(absl::StrCat(Counted(count, kind.one, kind.many), ": ", purpose));
  if (report.verdict() == v1::Report::TOO_LITTLE_DATA) cli.Log(report.summary());
  // What no further one can decide needs another measurement.
  for (const v1::Ambiguity& ambiguity : report.ambiguities())
    if (!ambiguity.discriminating_measurement().empty())
      cli.Log(absl::StrCat("to tell ", absl::StrJoin(ambiguity.effects(), " from "), ": ",
                           ambiguity.discriminating_measurement()));
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, report));
  if (report.next().empty()) {
    cli.Log(report.verdict() == v1::Report::TOO_LITTLE_DATA
                ? absl::StrCat("no ", kind.many, " to propose from so few: more are needed first",
                               client::MainData(report).needed() > 0
                                   ? absl::StrCat(" (", client::MainData(report).needed(), " usable ones)")
                                   : "",
                               "; touchstone plan writes some")
            : report.data_problems().empty()
                ? absl::StrCat("no ", kind.many, " to propose: no explanations are left that further ",
                               kind.many, " would tell apart")
                : absl::StrCat("no ", kind.many, " to propose before the set is fixed: ", report.summary()));
    return absl::OkStatus();
  }
  if (options.ReportOnStdout() && options.output.empty()) return absl::OkStatus();
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, kind.format(report)));
  cli.LogWritten(options.output, absl::StrCat(" (", Counted(report.next_size(), kind.one, kind.many), ")"));
  return absl::OkStatus();
}

absl::Status RunPropose(const Cli& cli, const ProposeOptions& options) {
  if (options.touches == 0u)
    return absl::InvalidArgumentError("--touches: 0 is out of range; 1 or more was expected");
  if (options.photographs == 0u)
    return absl::InvalidArgumentError("--photographs: 0 is out of range; 1 or more was expected");
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(cli, {{"--json", options.json}, {"-o", options.output}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  if (options.photographs && comparison->evidence().session().empty() && !comparison->evidence().has_images())
    return absl::InvalidArgumentError(
        absl::StrCat("--photographs: ", options.set(), " holds touches alone; --touches N proposes touches"));
  v1::ProposeRequest request;
  request.set_touches(options.touches.value_or(0));
  request.set_photographs(options.photographs.value_or(0));
  const bool both = comparison->evidence().has_images() &&
                    comparison->evidence().measurements_case() != v1::Evidence::MEASUREMENTS_NOT_SET;
  const absl::StatusOr<v1::Report> proposed =
      comparison->Run<v1::ProposeResponse>([&](grpc::ClientContext* context) {
        *request.mutable_evidence() = comparison->evidence();
        return comparison->connection().diagnosis().Propose(context, request);
      });
  if (!proposed.ok()) return InOptions(proposed.status());
  const v1::Report& report = *proposed;

  const bool pictures = client::MainData(report).kind() == v1::DataReport::PHOTOGRAPHS;
  if (both)
    cli.Log(pictures
                ? "from the photographs alone, without the touches beside them (--touches N proposes touches)"
                : "from the touches alone, without the photographs beside them");
  return WritePlan(cli, options,
                   pictures ? PlanKind{"picture", "pictures", PlanOfPhotographs}
                            : PlanKind{"touch", "touches", PlanOfTouches},
                   report);
}

}  // namespace

void AddPropose(Cli* cli) {
  auto options = std::make_shared<ProposeOptions>();
  CLI::App* command = cli->AddCommand(
      nullptr, "propose",
      "Writes a plan of the touches (or, of a folder, of the photographs) that would best tell apart the "
      "explanations "
      "that are left.",
      "touchstone propose set.csv --model nominal.yaml --mesh-dir meshes --touches 24 -o plan.csv\n"
      "touchstone touch --plan plan.csv -o more.csv\n"
      "touchstone propose photos --model nominal.yaml --mesh-dir meshes --photographs 12 -o next.csv\n"
      "touchstone capture lat20 --plan next.csv -o more/picture.png             its pictures of lat20\n"
      "touchstone rig photos lat20 --plan next.csv -o photos --server 127.0.0.1:50052",
      [cli, options] { return RunPropose(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
  command
      ->add_option("--touches", options->touches,
                   "How many touches to propose, also of a folder of both. Default: 24")
      ->type_name("N");
  command
      ->add_option("--photographs", options->photographs,
                   "Of a folder of photographs (or of both): how many pictures to propose. Default: 12")
      ->type_name("N");
  cli->AddOutput(command, "-o,--output", &options->output, "The plan (CSV) to write. Default: stdout");
}

}  // namespace touchstone::cli
