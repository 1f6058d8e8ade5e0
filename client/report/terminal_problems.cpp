// Check the data, in the terminal.
#include <absl/strings/str_cat.h>

#include "client/report/terminal_parts.h"
#include "client/report/words.h"

namespace touchstone::client {

void AddDataProblems(const v1::Report& report, TextLayout* out) {
  if (report.data_problems().empty()) return;
  out->Label("Check");
  for (const v1::DataProblem& problem : report.data_problems()) {
    std::string text = absl::StrCat(ProblemTitle(problem), ".");
    if (problem.rmse_before_us() > 0 && problem.rmse_after_us() > 0)
      absl::StrAppend(&text, " RMSE of the given model ",
                      TimeChange(problem.rmse_before_us(), problem.rmse_after_us()), " with the file fixed.");
    out->Paragraph(text);
    out->Paragraph(problem.words());
    if (!problem.fix().empty()) {
      out->Paragraph(absl::StrCat("To fix it (", problem.kind(), "):"));
      out->Verbatim(ShellLines(problem.fix(), out->room() - 4));
    }
  }
}

}  // namespace touchstone::client
