// Check the data, in the terminal.
#include <absl/strings/str_cat.h>

#include "client/report/error_scale.h"
#include "client/report/terminal_parts.h"

namespace touchstone::client {

void AddDataProblems(const v1::Report& report, TextLayout* out) {
  if (report.data_problems().empty()) return;
  out->Label("Check");
  const ErrorScale scale(report);
  for (const v1::DataProblem& problem : report.data_problems()) {
    std::string text = absl::StrCat(ProblemTitle(problem), ".");
    if (scale.Before(problem) > 0 && scale.After(problem) > 0)
      absl::StrAppend(&text, " RMSE of the given model ",
                      scale.Change(scale.Before(problem), scale.After(problem)), " with the ",
                      scale.grey() ? "set" : "file", " fixed.");
    out->Paragraph(text);
    out->Paragraph(problem.words());
    if (!problem.fix().empty()) {
      out->Paragraph(absl::StrCat("To fix it (", problem.kind(), "):"));
      out->Verbatim(ShellLines(problem.fix(), out->room() - 4));
    }
  }
}

}  // namespace touchstone::client
