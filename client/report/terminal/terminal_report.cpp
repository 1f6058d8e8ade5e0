// The report in the terminal: how wrong, where, why, ladder, what to do.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "client/report/report.h"
#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/error_scale.h"
#include "client/report/words/joint.h"

namespace touchstone::client {
namespace {

using TextCell = TextLayout::Cell;
constexpr double kSessionP = 0.01;

void AddOpening(const v1::Report& report, TextLayout* out) {
  std::string text = DataInWords(report, "x");
  absl::StrAppend(&text, ".");
  text += NoiseFloorSentences(report);
  out->Lead(text);
  for (const std::string& warning : report.warnings())
    out->Lead(absl::StrCat("Note: ", warning), TextLayout::kBad);
  out->Blank();
  const bool good = report.verdict() == v1::Report::ADEQUATE;
  const std::string verdict = VerdictWord(report);
  out->Lead(absl::StrCat(verdict, verdict.empty() ? "" : ": ", Headline(report)),
            good ? TextLayout::kGood : TextLayout::kBold);
  if (const std::string nothing = NothingMissingWords(report); !nothing.empty()) out->Lead(nothing);
  out->Blank();
}

void AddHowWrong(const v1::Report& report, TextLayout* out) {
  const v1::DataReport& data = MainData(report);
  const ErrorScale scale(data);
  if (!(data.initial().rmse() > 0)) return;
  const std::string times = TimesTheFloor(report, data);
  out->Label("How wrong");
  out->Paragraph(
      absl::StrCat("RMSE ", scale.Text(data.initial().rmse()), times.empty() ? "" : ", ", times, "."));
  if (!FingerScatterWords(report).empty() && report.verdict() != v1::Report::ADEQUATE)
    out->Paragraph(absl::StrCat("Of the fingers, ", FingerScatterWords(report), "."));
  AddSilhouettes(report, out);
  for (const v1::DataReport& one : report.data()) {
    const std::string fingers = FingerBiasWords(one);
    if (!fingers.empty()) out->Paragraph(absl::StrCat("Mean residual of the fingers: ", fingers, "."));
  }
}

// The entries that are told of: of several sessions the one whose model is saved.
std::vector<const v1::DataReport*> ShownData(const v1::Report& report) {
  if (report.has_sessions()) return {&MainData(report)};
  std::vector<const v1::DataReport*> shown;
  for (const v1::DataReport& data : report.data()) shown.push_back(&data);
  return shown;
}

void AddWhere(const v1::Report& report, TextLayout* out) {
  std::vector<std::vector<TextCell>> rows;
  size_t widest = 0;
  for (const v1::DataReport* shown : ShownData(report)) {
    const v1::DataReport& data = *shown;
    const ErrorScale scale(data);
    for (const v1::Slice& slice : data.where()) {
      if (rows.size() == 6) break;
      const std::string words = slice.words().empty()
                                    ? absl::StrCat("mean residual ", scale.Signed(slice.mean_residual()))
                                    : slice.words();
      const std::string share = Share(slice.share_of_excess_error());
      widest = std::max(widest, share.size());
      rows.push_back({{slice.slice()},
                      {absl::StrCat(Count(slice.count()), " ", scale.readings()), true},
                      {absl::StrCat(share, rows.empty() ? " of the excess" : ""), false},
                      {words}});
    }
  }
  if (rows.empty()) return;
  out->Label("Where");
  // Right-align the shares though only the first says of what.
  for (auto& row : rows) row[2].text.insert(0, widest - std::min(widest, row[2].text.find(" %") + 2), ' ');
  out->Rows(rows);
}

// Whether the fingers' residuals depend on the place in the session, with the given and with the improved model.
void AddSession(const v1::Report& report, TextLayout* out) {
  std::vector<const v1::CovariateCurve*> curves;
  for (const v1::DataReport* data : ShownData(report))
    for (const v1::CovariateCurve* curve : SessionCurves(*data)) curves.push_back(curve);
  if (curves.empty()) return;
  const bool improved = !report.improved_model_yaml().empty();
  double smallest = 1;
  for (const v1::CovariateCurve* curve : curves)
    for (const v1::FingerDependence& finger : curve->fingers())
      smallest = std::min({smallest, finger.p(), finger.p_after()});
  out->Label("Session");
  if (smallest > kSessionP) {
    out->Paragraph(absl::StrCat(
        "No finger's mean residual changes with ", CovariateName(curves[0]->covariate()),
        curves.size() > 1 ? " or the touch's number" : "", " (p ", Probability(smallest), " at least)."));
    return;
  }
  std::vector<std::vector<TextCell>> rows = {{{"against"}}};
  for (const v1::FingerDependence& finger : curves[0]->fingers())
    rows[0].push_back({absl::StrCat("finger ", finger.finger()), true});
  for (TextCell& cell : rows[0]) cell.style = TextLayout::kDim;
  for (const v1::CovariateCurve* curve : curves) {
    std::vector<TextCell> row = {{CovariateName(curve->covariate())}};
    for (const v1::FingerDependence& finger : curve->fingers())
      row.push_back({absl::StrCat("p ", Probability(finger.p()),
                                  improved ? absl::StrCat(" -> ", Probability(finger.p_after())) : ""),
                     true});
    rows.push_back(row);
  }
  out->Rows(rows);
}

void AddLadder(const v1::Report& report, TextLayout* out) {
  const std::vector<Rung> rungs = Ladder(report, MainData(report));
  if (rungs.empty()) return;
  out->Label("Ladder");
  const ErrorScale scale(MainData(report));
  double largest = 0;
  int names = 0;
  bool heldout = false, p = false;
  for (const Rung& rung : rungs) {
    largest = std::max(largest, rung.rmse);
    names = std::max(names, Columns(rung.name));
    heldout |= !std::isnan(rung.heldout_rmse);
    p |= !std::isnan(rung.lack_of_fit_p);
  }
  const bool wide = out->width() >= 96;
  const int bar = std::clamp(out->room() - names - 2 - (wide ? 35 : 11) - (scale.pictures() ? 5 : 0), 10, 40);
  std::vector<std::vector<TextCell>> rows;
  if (wide && (heldout || p)) {
    rows.push_back({{""},
                    {""},
                    {"RMSE", true, TextLayout::kDim},
                    {heldout ? "unseen" : "", true, TextLayout::kDim},
                    {p ? "lack of fit p" : "", true, TextLayout::kDim}});
  }
  for (const Rung& rung : rungs) {
    std::vector<TextCell> row = {{rung.name},
                                 {std::string(BarLength(rung.rmse, largest, bar), '#'), false,
                                  rung.kind == Rung::kFloor ? TextLayout::kDim : TextLayout::kBar}};
    row.push_back({scale.Text(rung.rmse), true});
    if (wide && (heldout || p)) {
      row.push_back({std::isnan(rung.heldout_rmse) ? "" : scale.Text(rung.heldout_rmse), true});
      row.push_back({std::isnan(rung.lack_of_fit_p) ? "" : Probability(rung.lack_of_fit_p), true});
    }
    rows.push_back(row);
  }
  out->Rows(rows);
}

}  // namespace

std::string TerminalReport(const v1::Report& report, int width, bool colour) {
  TextLayout out(width, colour);
  AddOpening(report, &out);
  if (report.has_sessions())
    AddSessions(report, &out);
  else
    AddHowWrong(report, &out);
  AddVersus(report, &out);
  AddDataProblems(report, &out);
  AddJoint(report, &out);
  AddDistributions(report, &out);
  AddWhere(report, &out);
  AddWorstPhotographs(report, &out);
  AddSession(report, &out);
  AddWhy(report, &out);
  AddUnexplained(report, &out);
  AddLadder(report, &out);
  AddBudget(report, &out);
  AddBlindSpots(report, &out);
  AddWhatToDo(report, &out);
  AddNext(report, &out);
  AddUnusedRows(report, &out);
  return out.Take();
}

}  // namespace touchstone::client
