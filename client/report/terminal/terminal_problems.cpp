// Check the data, in the terminal.
#include <absl/strings/str_cat.h>

#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/error_scale.h"

namespace touchstone::client {

void AddDataProblems(const v1::Report& report, TextLayout* out) {
  if (report.data_problems().empty()) return;
  out->Label("Check");
  for (const v1::DataProblem& problem : report.data_problems()) {
    const ErrorScale scale(DataOf(report, problem));
    std::string text = absl::StrCat(ProblemTitle(problem), ".");
    if (problem.error_before() > 0 && problem.error_after() > 0)
      absl::StrAppend(&text, " RMSE of the given model ",
                      scale.Change(problem.error_before(), problem.error_after()), " with the ",
                      scale.pictures() ? "set" : "file", " fixed.");
    out->Paragraph(text);
    out->Paragraph(problem.words());
    if (!problem.fix().empty()) {
      out->Paragraph(absl::StrCat("To fix it (", ProblemName(problem), "):"));
      out->Verbatim(ShellLines(problem.fix(), out->room() - 4));
    }
  }
}

}  // namespace touchstone::client
