// The page: the verdict first, then what to do, then the evidence for it.
#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/joint.h"
#include "client/report/report.h"
#include "client/report/words.h"
#include "server/base/units.h"

namespace touchstone::client {

std::string HtmlReport(const v1::Report& report) {
  std::string page = absl::StrCat(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
      "script-src 'unsafe-inline'",
      MainData(report).photographs().maps().empty() ? "" : "; img-src data:", "\">\n<title>",
      Escape(report.model_name().empty() ? "Touchstone report"
                                         : absl::StrCat("Touchstone report: ", report.model_name())),
      "</title>\n<style>", HtmlStyle(), "</style>\n</head>\n<body>\n<main>\n");
  // Where nothing of the catalogue is the answer, what is known of the rest comes before what was tried.
  const bool no_name = report.verdict() == v1::Report::UNEXPLAINED && report.steps().empty();
  for (const auto part :
       {HtmlHead, HtmlDataProblems, HtmlJoint, HtmlWhatToDo, HtmlDistributions,
        no_name ? HtmlUnexplained : HtmlWhy, no_name ? HtmlWhy : HtmlUnexplained, HtmlPhotographs, HtmlWhere,
        HtmlObjects, HtmlFit, HtmlNextTouches, HtmlNextPhotographs, HtmlData, HtmlMethods, HtmlProvenance}) {
    page += part(report);
  }
  absl::StrAppend(&page, "<footer>Made by Touchstone", report.version().empty() ? "" : " ",
                  Escape(report.version()));
  if (report.duration_s() > 0)
    absl::StrAppend(&page, " in ", Typeset(Time(report.duration_s() * kMicrosecondsPerSecond)));
  absl::StrAppend(&page, ". This file is self-contained: it loads nothing.</footer>\n</main>\n<script>",
                  HtmlScript(), "</script>\n</body>\n</html>\n");
  return page;
}

}  // namespace touchstone::client
