// Check the data, in the terminal.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "client/report/terminal_parts.h"
#include "client/report/words.h"

namespace touchstone::client {

namespace {

// A command over as many lines as it needs, so that a shell takes them as one.
std::string ShellLines(const std::string& command, int columns) {
  std::string text, line;
  for (const absl::string_view word : absl::StrSplit(command, ' ')) {
    if (!line.empty() && static_cast<int>(line.size() + 1 + word.size()) > columns) {
      absl::StrAppend(&text, line, " \\\n");
      line.clear();
    }
    absl::StrAppend(&line, line.empty() ? "" : " ", word);
  }
  return text + line;
}

}  // namespace

void AddDataProblems(const v1::Report& report, TextLayout* out) {
  if (report.data_problems().empty()) return;
  out->Label("Check");
  for (const v1::DataProblem& problem : report.data_problems()) {
    std::string text = absl::StrCat(ProblemTitle(problem), ".");
    if (problem.rmse_before_us() > 0 && problem.rmse_after_us() > 0)
      absl::StrAppend(&text, " RMSE of the given model ",
                      TimeChange(problem.rmse_before_us(), problem.rmse_after_us()),
                      " with the file mended.");
    out->Paragraph(text);
    out->Paragraph(problem.words());
    if (!problem.fix().empty()) {
      out->Paragraph(absl::StrCat("To mend it (", problem.kind(), "):"));
      out->Verbatim(ShellLines(problem.fix(), out->room() - 4));
    }
  }
}

}  // namespace touchstone::client
