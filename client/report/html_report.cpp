// The page: its template with the report and the sentences that the terminal shows too.
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include <cmath>

#include "client/report/report.h"
#include "client/report/report_json.h"
#include "client/report/words/joint.h"
#include "client/report/words/next_commands.h"
#include "client/report/words/words.h"
#include "client/workbench/page.h"
#include "server/base/status.h"

namespace touchstone::client {
namespace {

using nlohmann::json;

constexpr int kCommandColumns = 96;  // that a page has room for

json NumberOrNull(double value) {
  return std::isfinite(value) ? json(value) : json();
}

json LadderJson(const v1::Report& report, const v1::DataReport& data) {
  static const char* const kKinds[] = {"given", "refit", "step", "suggestion", "floor"};
  json rungs = json::array();
  for (const Rung& rung : Ladder(report, data))
    rungs.push_back({{"kind", kKinds[rung.kind]},
                     {"name", rung.name},
                     {"rmse", NumberOrNull(rung.rmse)},
                     {"heldout_rmse", NumberOrNull(rung.heldout_rmse)},
                     {"lack_of_fit_p", NumberOrNull(rung.lack_of_fit_p)}});
  return rungs;
}

// By object, x y z and the standard uncertainty of the improved model's contact time of every contact in
// turn: for the picture on the object.
json UncertaintyJson(const v1::DataReport& data) {
  json objects = json::object();
  const auto rounded = [](double value) { return std::round(1000 * value) / 1000; };
  for (const v1::SurfacePoint& point : data.surface_points()) {
    if (!(point.std_uncertainty() > 0)) continue;
    json& list = objects[point.object()];
    for (const double value : {point.x_mm(), point.y_mm(), point.z_mm(), point.std_uncertainty()})
      list.push_back(rounded(value));
  }
  return objects;
}

json DataJson(const v1::Report& report, const v1::DataReport& data) {
  const Floor floor = NoiseFloorOf(data);
  json words = {{"kind_name", KindName(data.kind())},
                {"floor", floor.sigma},
                {"floor_is_bound", floor.bound},
                {"finger_bias", FingerBiasWords(data)},
                {"nearest_effect", NearestEffectWords(data.unexplained())},
                {"times_the_floor", TimesTheFloor(report, data)},
                {"uncertainty", UncertaintyJson(data)}};
  // Of one kind alone it is the report's.
  if (IsJoint(report)) words["ladder"] = LadderJson(report, data);
  return words;
}

// Sentences, names and commands that need the rules of words.h; the page writes numbers itself.
json PageWords(const v1::Report& report) {
  const v1::DataReport& main = MainData(report);
  json words = {{"headline", Headline(report)},
                {"summary", IsJoint(report) ? report.summary() : SummaryToShow(report)},
                {"data", DataInWords(report, "\u00d7")},
                {"floor", NoiseFloorSentences(report)},
                {"times_the_floor", TimesTheFloor(report, main)},
                {"nothing_missing", NothingMissingWords(report)},
                {"finger_scatter",
                 report.verdict() == v1::Report::ADEQUATE ? std::string() : FingerScatterWords(report)},
                {"ladder", LadderJson(report, main)},
                {"command", ShellLines(report.provenance().command(), kCommandColumns)}};
  for (const char* list : {"commands", "problems", "ambiguities", "next", "steps", "to_tell", "of_data"})
    words[list] = json::array();
  for (int i = 0; i < report.data_size(); ++i) {
    words["of_data"].push_back(DataJson(report, report.data(i)));
    if (&report.data(i) == &main) words["main"] = i;
  }
  for (const NextCommand& next : NextCommands(report))
    words["commands"].push_back({{"purpose", next.purpose}, {"command", next.command}});
  for (const v1::DataProblem& problem : report.data_problems())
    words["problems"].push_back(
        {{"title", ProblemTitle(problem)}, {"fix", ShellLines(problem.fix(), kCommandColumns)}});
  for (const v1::Ambiguity* ambiguity : OtherAmbiguities(report))
    words["ambiguities"].push_back({{"effects", json(std::vector<std::string>(ambiguity->effects().begin(),
                                                                              ambiguity->effects().end()))},
                                    {"to_decide", ToDecide(ambiguity->discriminating_measurement())}});
  for (const v1::NextMeasurement& next : report.next()) words["next"].push_back(CountToVerdict(next));
  for (const v1::Step& step : report.steps()) {
    words["steps"].push_back(StepName(step));
    words["to_tell"].push_back(WhatToTell(report, step));
  }
  return words;
}

}  // namespace

absl::StatusOr<std::string> PageData(const v1::Report& report) {
  v1::Report shown = report;
  shown.clear_posterior();  // of programs that draw from it
  // The table of touches says what these two do, and to which touch they belong.
  for (v1::DataReport& data : *shown.mutable_data())
    if (data.has_touch_table()) data.clear_parity(), data.clear_surface_points();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string report_json,
                              ReportToJson(std::move(shown), /*whitespace=*/false));
  // What nlohmann writes is escaped where text of others is no UTF-8.
  return absl::StrCat("{\"report\":", report_json,
                      ",\"words\":", PageWords(report).dump(-1, ' ', false, json::error_handler_t::replace),
                      "}");
}

absl::StatusOr<std::string> HtmlReport(const v1::Report& report) {
  TOUCHSTONE_RETURN_IF_ERROR(workbench::PageTemplate().status());
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string data, PageData(report));
  return workbench::FilledPage(data, workbench::PageReach::kNobody);
}

}  // namespace touchstone::client
