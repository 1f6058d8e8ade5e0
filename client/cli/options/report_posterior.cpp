#include "client/cli/options/report_posterior.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

using ReportJson = nlohmann::json;

constexpr char kExpected[] = "a report of `touchstone diagnose SET --json FILE` was expected";

// Why a report has no posterior.
std::string WhyNone(const ReportJson& report) {
  const std::string verdict = report.value("verdict", "VERDICT_UNSPECIFIED");
  const ReportJson data = report.value("data", ReportJson::array());
  const auto kind = [&](size_t i) { return data[i].value("kind", ""); };
  if (verdict == "CHECK_DATA")
    return "the set has a mistake (CHECK_DATA), and no model is claimed beside it: fix it first";
  if (verdict == "TOO_LITTLE_DATA") return "the set has too few measurements for a verdict (TOO_LITTLE_DATA)";
  if (data.size() == 2 && kind(0) != kind(1))
    return "it is one of touches and photographs together, whose values have no joint uncertainty yet: "
           "diagnose touches.csv by itself";
  if (data.size() == 1 && kind(0) == "PHOTOGRAPHS")
    return "it is one of photographs, whose own budget stands in the report; of other pictures nothing is "
           "predicted "
           "yet: give a report on touches";
  if (data.size() == 1 && kind(0) == "BOARDS")
    return "it is one of chessboards, whose own budget stands in the report; of other pictures nothing is "
           "predicted "
           "yet: give a report on touches";
  if (data.size() == 1 && kind(0) == "DISTRIBUTIONS")
    return "its touches have no poses, so that no value of a model was fitted";
  if (verdict == "VERDICT_UNSPECIFIED") return "it has no verdict, as of `touchstone compare`";
  if (data.size() > 1)
    return "the last of its sessions does not agree with what all of them say, or takes no part in it";
  return "it was written by a version that did not keep it: diagnose the set again";
}

// In the report's budget of all objects, us; 0: none was found.
double MisfitOf(const ReportJson& report) {
  const ReportJson budgets = report.value("uncertainty", ReportJson::array());
  if (!budgets.is_array() || budgets.empty() || !budgets.back().is_object()) return 0;
  for (const ReportJson& one : budgets.back().value("contributions", ReportJson::array()))
    if (one.is_object() && one.value("name", "") == "misfit" && one["std_uncertainty"].is_number())
      return one["std_uncertainty"];
  return 0;
}

}  // namespace

absl::StatusOr<ReportedPosterior> PosteriorOfReport(const std::string& path) {
  const absl::StatusOr<std::string> read = ReadFile(path);
  if (!read.ok())
    return absl::Status(read.status().code(), absl::StrCat(read.status().message(), "; ", kExpected));
  const std::string& text = *read;
  const ReportJson report = ReportJson::parse(text, nullptr, false);
  if (report.is_discarded() || !report.is_object())
    return absl::InvalidArgumentError(absl::StrCat(path, ": is no JSON object; ", kExpected));
  if (!report.contains("posterior")) {
    if (!report.contains("data") || !report["data"].is_array())
      return absl::InvalidArgumentError(absl::StrCat(path, ": is no report; ", kExpected));
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": the report says nothing of how sure its model is: ", WhyNone(report)));
  }
  ReportedPosterior found;
  const auto status =
      google::protobuf::util::JsonStringToMessage(report["posterior"].dump(), &found.posterior);
  if (!status.ok())
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": 'posterior' cannot be read: ", std::string(status.message())));
  if (report.value("verdict", "") == "UNEXPLAINED")
    found.note = absl::StrCat("note: ", path,
                              " says UNEXPLAINED: something is left that the model does not have, and its "
                              "predictions err by more than these uncertainties say");
  if (const double misfit_us = MisfitOf(report); misfit_us > 0)
    absl::StrAppend(&found.note, found.note.empty() ? "" : "\n", "note: the model of ", path,
                    " leaves a misfit of ", absl::StrFormat("%.3g ms", misfit_us / 1000),
                    " on the set that it was fitted to, which these uncertainties do not hold");
  return found;
}

}  // namespace touchstone::cli
