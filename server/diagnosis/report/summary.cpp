#include "server/diagnosis/report/summary.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/readable_time.h"

namespace touchstone {
namespace {

constexpr int kFewTouches = 100;

std::string Time(double us) {
  return TimeInWords(us * 1e-6);
}

// "tip_radius (radius_mm 1.5 +- 0.005 mm)"
std::string Value(const v1::ParameterValue& value) {
  std::string name = value.name();
  if (!value.finger().empty()) name += " " + value.finger();
  return absl::StrFormat("%s %.4g +- %.2g%s%s", name, value.value(), value.std_error(),
                         value.unit().empty() ? "" : " ", value.unit());
}

template <typename Parameters>
std::string Values(const Parameters& parameters) {
  constexpr int kMaxShown = 4;
  if (parameters.size() > kMaxShown) return absl::StrCat(parameters.size(), " values");
  std::vector<std::string> texts;
  for (const auto& value : parameters) texts.push_back(Value(value));
  return absl::StrJoin(texts, ", ");
}

std::string HowWrong(const v1::Report& report) {
  const double rmse = report.initial().rmse_us(), floor = report.noise_floor_us();
  if (!(floor > 0)) return absl::StrCat("The model is off by ", Time(rmse), ".");
  return absl::StrFormat(
      "The model is off by %s; %s is noise%s, so %.3g %% of the mean square error is the model's.",
      Time(rmse), Time(floor), report.noise_floor().from_repeats() ? "" : " at most",
      report.reducible_share() * 100);
}

}  // namespace

void DescribeData(const Observations& o, v1::Report* report) {
  const MeasurementSet& set = *o.set;
  v1::DataSummary* data = report->mutable_data();
  data->set_origin(set.origin);
  data->set_rows(set.size());
  for (const auto& [reason, unused] : o.unused) {
    *data->add_unused() = unused;
    if (reason.rfind("an outlier", 0) == 0) data->set_outliers(data->outliers() + unused.rows());
  }
  for (const std::string& object : o.objects) data->add_objects(object);
  for (int finger = 0; finger < o.fingers; ++finger) report->add_fingers(FingerName(finger, o.fingers));
  std::set<int> poses, rounds;
  std::set<double> speeds;
  uint32_t used = 0, missed = 0;
  for (int k = 0; k < o.size(); ++k) {
    for (int i = 0; i < o.fingers; ++i)
      missed += std::isnan(o.time_s[static_cast<size_t>(k) * o.fingers + i]);
    if (!o.used[k]) continue;
    ++used;
    poses.insert(o.pose[k]);
    if (!set.round.empty()) rounds.insert(set.round[o.row[k]]);
    if (speeds.size() < 20) speeds.insert(std::round(set.speed_m_s[o.row[k]] * 1e6) / 1e3);
  }
  data->set_poses(static_cast<uint32_t>(poses.size()));
  data->set_repeats(used - data->poses());
  data->set_rounds(static_cast<uint32_t>(rounds.size()));
  for (const double speed : speeds) data->add_speeds_mm_s(speed);
  data->set_missed_contacts(missed);
  report->set_touches(used);
}

void AddWarnings(const Observations& o, v1::Report* report) {
  const v1::DataSummary& data = report->data();
  if (report->touches() == 0) {
    report->add_warnings("No touch could be used: nothing can be said of the model.");
    return;
  }
  if (report->touches() < kFewTouches)
    report->add_warnings(absl::StrCat("Only ", report->touches(),
                                      report->touches() == 1 ? " touch" : " touches",
                                      " took part: weak effects stay unseen, and errors are rough."));
  if (data.objects_size() == 1)
    report->add_warnings(
        "One object only: what belongs to the rig and what to this object cannot be told apart well. Touch "
        "at least "
        "three objects.");
  if (data.repeats() == 0)
    report->add_warnings(
        "No touch was repeated: the noise floor is an upper bound, taken from what the best model leaves.");
  uint32_t unused = 0;
  for (const v1::UnusedRows& rows : data.unused()) unused += rows.rows();
  if (unused * 5 > data.rows())
    report->add_warnings(
        absl::StrFormat("%d of %d rows could not be used; see the reasons.", unused, data.rows()));
}

std::string Summary(const v1::Report& report) {
  if (report.touches() == 0) return "No touch could be used: nothing can be said of the model.";
  std::vector<std::string> sentences = {HowWrong(report)};
  for (const v1::Refit& refit : report.refitted())
    sentences.push_back(absl::StrCat("In the model ", refit.effect(),
                                     " has another value: ", Values(refit.parameters()), "."));
  for (const v1::Step& step : report.steps()) {
    std::string name = step.effect();
    for (const std::string& other : step.equivalent()) absl::StrAppend(&name, " or ", other);
    sentences.push_back(absl::StrCat("Missing: ", name, " (", Values(step.parameters()), ")."));
    if (step.equivalent_size() > 0)
      sentences.push_back(absl::StrCat("These data cannot tell them apart. ", step.decided_by()));
  }
  switch (report.verdict()) {
    case v1::Report::ADEQUATE:
      sentences.push_back("Nothing is missing that these data could show.");
      break;
    case v1::Report::UNEXPLAINED:
      if (!report.unexplained().formula().empty())
        sentences.push_back(absl::StrCat("What remains follows no effect of the catalogue; it depends on ",
                                         report.unexplained().covariates_size() > 0
                                             ? report.unexplained().covariates(0).name()
                                             : "something",
                                         ". A suggestion: ", report.unexplained().formula(), " (",
                                         Values(report.unexplained().parameters()), ") would leave ",
                                         Time(report.unexplained().rmse_us()), "."));
      else
        sentences.push_back(
            "A structure remains that neither an effect of the catalogue nor a simple formula explains.");
      break;
    case v1::Report::MISSING_EFFECTS:
    case v1::Report::WRONG_VALUES:
      sentences.push_back(absl::StrCat("Then ", Time(report.final().rmse_us()), " is left."));
      break;
    default:
      break;
  }
  return absl::StrJoin(sentences, " ");
}

}  // namespace touchstone
