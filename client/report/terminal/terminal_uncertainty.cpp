// How well a model predicts, in the terminal.
#include <absl/strings/str_cat.h>

#include "client/report/report.h"
#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/error_scale.h"
#include "client/report/words/text_layout.h"
#include "client/report/words/words.h"

namespace touchstone::client {
namespace {

using BudgetCell = TextLayout::Cell;

std::vector<BudgetCell> BudgetRow(const v1::UncertaintyBudget& budget, bool reproducibility,
                                  const ErrorScale& scale) {
  const auto text = [&scale](double value) { return BudgetCell{scale.Text(value), true}; };
  std::vector<BudgetCell> row = {{budget.object().empty() ? "all" : budget.object()},
                                 {Count(budget.touches()), true},
                                 text(budget.parameters()),
                                 text(budget.surface()),
                                 text(budget.repeatability())};
  if (reproducibility) row.push_back(text(budget.reproducibility()));
  row.push_back({scale.Text(budget.combined()), true, TextLayout::kBold});
  row.push_back({Count(budget.beyond_measured()), true});
  std::string largest;
  if (budget.contributions_size() > 0)
    largest = absl::StrCat(budget.contributions(0).name(), " ", Share(budget.contributions(0).share()));
  row.push_back({largest});
  return row;
}

constexpr int kBudgetBar = 20;

}  // namespace

void AddBudget(const v1::Report& report, TextLayout* out) {
  if (report.data_size() == 2 && report.data(0).kind() != report.data(1).kind() &&
      !report.improved_model_hash().empty()) {
    out->Label("Budget");
    out->Paragraph(
        "None: values that touches and photographs share have no joint uncertainty yet. Diagnose each by "
        "itself: touches.csv, and the folder without it.");
  }
  if (report.data().empty() || report.uncertainty().empty()) return;
  const v1::UncertaintyBudget& all = report.uncertainty(report.uncertainty_size() - 1);
  if (all.contributions().empty()) return;
  const ErrorScale scale(report.data(0));
  out->Label("Budget");
  const char* const reading = scale.kind() == v1::DataReport::PHOTOGRAPHS ? "A pixel of a new photograph"
                              : scale.kind() == v1::DataReport::BOARDS
                                  ? "A corner in a new picture of the board"
                                  : "A new reading of a finger, less the mean over its touch,";
  out->Paragraph(absl::StrCat(reading, " is predicted with a standard uncertainty of ",
                              scale.Text(all.combined()), ". Of that:"));
  std::vector<std::vector<BudgetCell>> rows;
  for (const v1::UncertaintyBudget::Contribution& contribution : all.contributions())
    rows.push_back(
        {{contribution.name()},
         {scale.Text(contribution.std_uncertainty()), true},
         {Share(contribution.share()), true},
         {std::string(BarLength(contribution.share(), 1, kBudgetBar), '#'), false, TextLayout::kBar}});
  out->Rows(rows);
}

std::string TerminalUncertainty(const v1::Report& report, int width, bool colour) {
  TextLayout out(width, colour);
  if (report.data().empty() || report.uncertainty().empty()) return out.Take();
  const v1::DataReport& data = report.data(0);
  const ErrorScale scale(data);
  out.Lead(absl::StrCat(data.session().empty() ? "" : absl::StrCat(data.session(), ": "), "model '",
                        report.model_name(), "'."));
  for (const std::string& warning : report.warnings())
    out.Lead(absl::StrCat("Note: ", warning), TextLayout::kBad);
  out.Blank();
  out.Lead(report.summary(), TextLayout::kBold);
  out.Blank();
  const bool estimated = report.uncertainty(report.uncertainty_size() - 1).has_reproducibility();
  std::vector<std::vector<BudgetCell>> rows(1);
  for (const char* name : {"object", "touches", "parameters", "surface", "repeatability", "reproducibility",
                           "combined", "beyond", "largest"})
    if (estimated || name != std::string("reproducibility"))
      rows[0].push_back(
          {name, name != std::string("object") && name != std::string("largest"), TextLayout::kDim});
  // One object is all.
  const int count = report.uncertainty_size() == 2 ? 1 : report.uncertainty_size();
  for (int i = 0; i < count; ++i) rows.push_back(BudgetRow(report.uncertainty(i), estimated, scale));
  out.Rows(rows);
  out.Blank();
  AddBudget(report, &out);
  out.Blank();
  out.Lead(
      absl::StrCat("Standard uncertainties of a finger's next reading, less the mean over its touch, root "
                   "mean squares over the "
                   "touches; the worst finger of the worst touch: ",
                   scale.Text(report.uncertainty(report.uncertainty_size() - 1).largest()),
                   ". beyond: touches that meet the object where nothing was measured near."));
  if (!estimated)
    out.Lead(
        "reproducibility: not estimated, the model comes from one session; diagnose several together "
        "(touchstone diagnose MONDAY FRIDAY).");
  return out.Take();
}

}  // namespace touchstone::client
