#include "client/report/terminal/terminal_parts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include "client/report/words/error_scale.h"
#include "client/report/words/next_commands.h"

namespace touchstone::client {
namespace {

using TextCell = TextLayout::Cell;
constexpr int kMaxParameters = 6;  // of one effect
constexpr int kMaxCompetingEffects = 3;

// "2.98 +- 0.02 mm", with the name where it does not go without saying.
std::string Parameter(const v1::ParameterValue& parameter, bool named) {
  std::string text = ValueWithError(parameter);
  if (parameter.has_before()) {
    v1::ParameterValue before;
    before.set_value(parameter.before());
    before.set_unit(parameter.unit());
    absl::StrAppend(&text, ", was ", ValueWithError(before));
  }
  return named ? absl::StrCat(ParameterName(parameter), " ", text) : text;
}

// Finger and object name the values of an effect that has one parameter for each.
bool HasOneParameter(const google::protobuf::RepeatedPtrField<v1::ParameterValue>& parameters) {
  return !parameters.empty() && std::all_of(parameters.begin(), parameters.end(), [&](const auto& p) {
    return p.name() == parameters[0].name() && !(p.finger().empty() && p.object().empty());
  });
}

// One row per effect, and one more for each further parameter.
template <typename Effect>
void AddEffect(const Effect& effect, const std::string& name, double probability, const std::string& change,
               const std::string& note, TextLayout::Style style, std::vector<std::vector<TextCell>>* rows) {
  auto parameters = effect.parameters();
  if (HasOneParameter(parameters)) {
    for (auto& parameter : parameters) {
      const bool both = !parameter.finger().empty() && !parameter.object().empty();
      parameter.set_name(absl::StrCat(parameter.finger(), both ? ", " : "", parameter.object()));
      parameter.clear_finger();
      parameter.clear_object();
    }
  }
  const bool named =
      parameters.size() > 1 ||
      (parameters.size() == 1 && (!parameters[0].finger().empty() || !parameters[0].object().empty()));
  const std::string first = parameters.empty() ? "" : Parameter(parameters[0], named);
  const std::string p = EffectProbability(probability);
  rows->push_back({{name, false, style},
                   {first, false, style},
                   {p, true, style},
                   {change, true, style},
                   {note, false, TextLayout::kDim}});
  for (int i = 1; i < std::min<int>(parameters.size(), kMaxParameters); ++i) {
    rows->push_back({{""}, {Parameter(parameters[i], true), false, style}, {""}, {""}, {""}});
  }
  if (parameters.size() > kMaxParameters) {
    rows->push_back(
        {{""},
         {absl::StrCat("... ", parameters.size() - kMaxParameters, " more values"), false, TextLayout::kDim},
         {""},
         {""},
         {""}});
  }
}

// Without poses there is no RMSE.
std::string Change(const ErrorScale& scale, double before, double after) {
  return before > 0 && after > 0 ? scale.Change(before, after) : "";
}

}  // namespace

void AddDistributions(const v1::Report& report, TextLayout* out) {
  if (!MainData(report).has_distributions()) return;
  const v1::DistributionComparison& comparison = MainData(report).distributions();
  out->Label("How wrong");
  out->Paragraph(absl::StrCat("The set has no poses, so only distributions can be compared: energy distance ",
                              Number(comparison.energy_distance()), ", p ", Probability(comparison.p()),
                              ", against ", Count(comparison.simulated_touches()), " simulated touches",
                              comparison.plan().empty() ? "" : absl::StrCat(" (", comparison.plan(), ")"),
                              "."));
  if (comparison.statistics_size() > 0) {
    std::vector<std::vector<TextCell>> rows = {{{"", false},
                                                {"measured", true, TextLayout::kDim},
                                                {"simulated", true, TextLayout::kDim},
                                                {"p", true, TextLayout::kDim}}};
    for (const v1::StatisticTest& test : comparison.statistics()) {
      const bool time = test.unit() == "us";
      const std::string unit = test.unit().empty() ? "" : absl::StrCat(" ", test.unit());
      rows.push_back({{test.name()},
                      {time ? Time(test.measured()) : absl::StrCat(Number(test.measured()), unit), true},
                      {time ? Time(test.simulated()) : absl::StrCat(Number(test.simulated()), unit), true},
                      {Probability(test.p()), true}});
    }
    out->Rows(rows);
  }
  for (const v1::RepeatFinding& finding : comparison.findings())
    out->Paragraph(absl::StrCat(finding.words(), " p ", Probability(finding.p()), "."));
  if (comparison.compatible_effects_size() > 0) {
    out->Label("Why");
    out->Paragraph(absl::StrCat("The difference could be explained by ",
                                absl::StrJoin(comparison.compatible_effects(), ", "),
                                "; only touches with poses can tell which."));
  }
}

void AddWhy(const v1::Report& report, TextLayout* out) {
  std::vector<std::vector<TextCell>> rows;
  const v1::DataReport& data = MainData(report);
  const ErrorScale scale(data);
  double before = UnseenError(data.initial());
  if (report.steps_size() > 0) {
    const std::string unseen = before > 0 ? absl::StrCat("unseen ", scale.readings()) : "";
    rows.push_back(
        {{""}, {""}, {"probability", true, TextLayout::kDim}, {unseen, true, TextLayout::kDim}, {""}});
  }
  // A joint report ranks each kind's; their errors are told where they are of the same kind as the steps'.
  std::vector<const v1::Candidate*> candidates;
  std::set<const v1::Candidate*> of_data;
  for (const v1::DataReport& one : report.data())
    for (const v1::Candidate& candidate : one.candidates()) {
      candidates.push_back(&candidate);
      if (&one == &data) of_data.insert(&candidate);
    }
  std::set<std::string> named;
  for (const v1::Refit& refit : report.refitted()) {
    AddEffect(refit, refit.effect(), std::nan(""), "", "put right", TextLayout::kPlain, &rows);
    named.insert(refit.effect());
  }
  for (const v1::Step& step : report.steps()) {
    named.insert(step.effect());
    named.insert(step.equivalent().begin(), step.equivalent().end());
  }
  for (int i = 0; i < report.steps_size(); ++i) {
    const v1::Step& step = report.steps(i);
    const double after = i < data.after_step_size() ? UnseenError(data.after_step(i)) : 0;
    // The probability is that of the step with its equivalents.
    std::string note =
        step.equivalent().empty() ? "" : absl::StrCat("one of ", 1 + step.equivalent_size(), ", see below");
    if (step.shown_by_size() > 0)
      absl::StrAppend(&note, note.empty() ? "" : "; ", "shown by ",
                      step.shown_by_size() > 1
                          ? "touches and pictures"
                          : absl::AsciiStrToLower(KindName(step.shown_by(0))) + " alone");
    AddEffect(step, absl::StrCat(i == 0 ? "" : "+ ", step.effect()), step.probability(),
              Change(scale, before, after), note, TextLayout::kPlain, &rows);
    // What else could stand in the place of the first step.
    for (size_t c = 0, shown = 0; i == 0 && c < candidates.size() && shown < kMaxCompetingEffects; ++c) {
      const v1::Candidate& candidate = *candidates[c];
      if (!(candidate.gain_nats() > 0) || !named.insert(candidate.effect()).second) continue;
      AddEffect(candidate, candidate.effect(), candidate.probability(),
                of_data.count(&candidate) > 0 ? Change(scale, before, UnseenError(candidate)) : "",
                candidate.note(), TextLayout::kDim, &rows);
      ++shown;
    }
    before = after;
  }
  if (!rows.empty()) out->Label("Why");
  out->Rows(rows);
  for (const v1::Step& step : report.steps()) {
    if (step.equivalent().empty()) continue;
    const std::string p = EffectProbability(step.probability());
    out->Paragraph(absl::StrCat(StepName(step), ": these data cannot tell them apart",
                                p.empty() ? "" : absl::StrCat(" (one of these: ", p, ")"), ". ",
                                ToDecide(step.discriminating_measurement())));
  }
  for (const v1::Ambiguity* ambiguity : OtherAmbiguities(report)) {
    const std::vector<std::string> effects(ambiguity->effects().begin(), ambiguity->effects().end());
    out->Paragraph(absl::StrCat(Join(effects, "or"), ": these data cannot tell them apart. ",
                                ToDecide(ambiguity->discriminating_measurement())));
  }
}

// A curve that has no name yet.
void AddLookup(const v1::Unexplained& rest, TextLayout* out) {
  if (rest.lookup_yaml().empty()) return;
  std::string text = "No name fits, but a curve does";
  if (rest.heldout_gain() > 0)
    absl::StrAppend(&text, ": it removes ", Share(rest.heldout_gain()),
                    " of the excess error on unseen data");
  if (!rest.nearest_formula().empty())
    absl::StrAppend(&text, "; the nearest simple formula is ", rest.nearest_formula(), " with ",
                    Share(rest.nearest_formula_share()), " of its gain in log evidence");
  const std::string nearest = NearestEffectWords(rest);
  if (!nearest.empty()) absl::StrAppend(&text, "; ", nearest);
  out->Paragraph(text + ". --save-model FILE --with-formula writes the model with it.");
}

// What one kind of measurement leaves.
void AddRest(const v1::Unexplained& rest, const ErrorScale& scale, TextLayout* out) {
  if (!rest.covariates().empty()) {
    std::vector<std::string> names;
    for (int i = 0; i < std::min(rest.covariates_size(), 4); ++i) {
      const double p = rest.covariates(i).p();
      names.push_back(absl::StrCat(CovariateName(rest.covariates(i).name()), " (p ", Probability(p), ")"));
    }
    std::string text = absl::StrCat("The rest depends on ", names[0], ".");
    names.erase(names.begin());
    if (!names.empty())
      absl::StrAppend(&text, " Each alone, it would also follow ", absl::StrJoin(names, ", "),
                      "; these may only go along.");
    out->Paragraph(text);
  }
  if (rest.formula().empty()) {
    AddLookup(rest, out);
    return;
  }
  std::string text = absl::StrCat("A suggestion, not a cause: ", rest.formula());
  if (rest.heldout_gain() > 0) {
    absl::StrAppend(&text, " removes ", Share(rest.heldout_gain()), " of the excess error on unseen ",
                    scale.readings());
  }
  const std::string nearest = NearestEffectWords(rest);
  if (!nearest.empty()) absl::StrAppend(&text, "; ", nearest);
  out->Paragraph(text + ".");
  for (const v1::ParameterValue& parameter : rest.parameters()) out->Paragraph(Parameter(parameter, true));
  if (rest.formula_yaml().empty()) return;
  out->Paragraph(
      "--save-model FILE --with-formula adds it in its place and fits the other effects beside it. As text:");
  out->Verbatim(rest.formula_yaml());
}

void AddUnexplained(const v1::Report& report, TextLayout* out) {
  std::set<std::string> told;  // a contradiction concerns both kinds
  for (const v1::DataReport& data : report.data()) {
    const v1::Unexplained& rest = data.unexplained();
    if (rest.covariates().empty() && rest.formula().empty() && rest.words().empty()) continue;
    if (told.empty()) out->Label("Unexplained");
    const bool is_new = told.insert(rest.words()).second;
    const std::string kind = report.data_size() > 1 ? absl::StrCat(KindName(data.kind()), ": ") : "";
    if (!rest.words().empty() && is_new) out->Paragraph(absl::StrCat(kind, rest.words()));
    AddRest(rest, ErrorScale(data), out);
  }
}

void AddWhatToDo(const v1::Report& report, TextLayout* out) {
  out->Label("What to do");
  const std::string summary = SummaryToShow(report);
  if (!summary.empty()) out->Paragraph(summary);
  for (const v1::Step& step : report.steps()) {
    std::string text = step.meaning();
    if (!step.words().empty()) absl::StrAppend(&text, text.empty() ? "" : " ", step.words());
    if (!step.remedy().empty()) absl::StrAppend(&text, text.empty() ? "" : " ", step.remedy());
    if (!text.empty()) out->Paragraph(absl::StrCat(step.effect(), ": ", text));
    if (!step.check_on_rig().empty()) {
      out->Paragraph(absl::StrCat("To check on the rig: ", step.check_on_rig()));
    }
  }
  if (!report.improved_model_hash().empty()) {
    out->Paragraph(absl::StrCat("The improved model has the hash ",
                                report.improved_model_hash().substr(0, 12), "... (--save-model writes it)."));
  }
  for (const NextCommand& next : NextCommands(report)) {
    out->Paragraph(absl::StrCat(next.purpose, ":"));
    out->Verbatim(next.command);
  }
  out->Label("");
}

namespace {

void AddNextTouches(const v1::Report& report, TextLayout* out) {
  struct Purpose {
    std::set<std::string> objects;
    int touches = 0;
    double separation = 0;
    std::string verdict;
  };
  std::vector<std::string> order;
  std::map<std::string, Purpose> purposes;
  for (const v1::NextMeasurement& next : report.next()) {
    if (!next.has_touch()) continue;
    if (purposes.count(next.purpose()) == 0) order.push_back(next.purpose());
    Purpose& purpose = purposes[next.purpose()];
    purpose.objects.insert(next.object());
    ++purpose.touches;
    purpose.separation = std::max(purpose.separation, next.separation());
    purpose.verdict = CountToVerdict(next);
  }
  if (!order.empty()) out->Label("Next touches");
  for (const std::string& name : order) {
    const Purpose& purpose = purposes[name];
    out->Paragraph(
        absl::StrCat(purpose.touches, " on ", absl::StrJoin(purpose.objects, ", "), name.empty() ? "" : ": ",
                     name, "; up to ", Number(purpose.separation, 2), " noise sigmas apart per touch",
                     purpose.verdict.empty() ? "" : absl::StrCat("; ", purpose.verdict), "."),
        TextLayout::kPlain, 2);
  }
}

}  // namespace

void AddNext(const v1::Report& report, TextLayout* out) {
  AddNextTouches(report, out);
  AddNextPhotographs(report, out);
}

void AddUnusedRows(const v1::Report& report, TextLayout* out) {
  uint64_t unused = 0, rows = 0;
  for (const v1::DataReport& data : report.data())
    unused += data.set_aside().count(), rows += data.set().rows();
  if (unused == 0) return;
  out->Label("Not used");
  out->Paragraph(absl::StrCat(Count(unused), " of ", Count(rows), " rows:"));
  for (const v1::DataReport& data : report.data())
    for (const v1::UnusedRows& one : data.set_aside().rows()) {
      std::string text = absl::StrCat(Count(one.rows()), ": ", one.reason());
      if (!one.examples().empty()) {
        const int shown = std::min(one.examples_size(), 5);
        absl::StrAppend(&text, one.examples_size() == 1 && one.rows() == 1 ? " (touch " : " (touches ",
                        absl::StrJoin(one.examples().begin(), one.examples().begin() + shown, ", "),
                        one.rows() > static_cast<uint32_t>(shown) ? ", ...)" : ")");
      }
      out->Paragraph(text, TextLayout::kPlain, 2);
    }
}

}  // namespace touchstone::client
