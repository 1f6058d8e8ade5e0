#include "tests/hidden_effects/score/judge.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/generator/unlisted.h"

namespace touchstone::hidden {
namespace {

using Names = std::vector<std::string>;

bool Contains(const Names& names, const std::string& name) {
  return std::count(names.begin(), names.end(), name) > 0;
}

Names EquivalentsOf(const v1::Step& step) {
  return Names(step.equivalent().begin(), step.equivalent().end());
}

// Whether a step is the truth: by its name, or as one of a class that these data cannot distinguish, if the
// step says so.
bool Names_(const v1::Step& step, const Hidden& truth, const Scenario& scenario) {
  if (step.effect() == truth.effect) return true;
  return Contains(EquivalentEffects(truth, scenario), step.effect()) &&
         Contains(EquivalentsOf(step), truth.effect);
}

// The hidden value that a parameter of the report estimates. False: there is none.
bool TrueValue(const v1::ParameterValue& parameter, const Hidden& truth, const Scenario& scenario,
               double* value) {
  const auto& values = truth.values;
  if (truth.effect == "object_pose") {
    size_t at = parameter.name() == "translation_mm" ? 0 : 3;
    const size_t axis = std::string("xyz").find(parameter.finger());
    if (parameter.finger().size() != 1 || axis == std::string::npos) return false;
    at += axis;
    if (values.size() > 6) {
      size_t object = 0;
      while (object < scenario.objects.size() && scenario.objects[object]->name() != parameter.object())
        ++object;
      if (object == scenario.objects.size()) return false;  // one value for objects that differ
      at += 6 * object;
    }
    *value = values[at];
    return true;
  }
  if (ValueCount(truth.effect, scenario.fingers) == scenario.fingers && scenario.fingers > 1) {
    for (int i = 0; i < scenario.fingers; ++i) {
      const std::string name = scenario.fingers == 3 ? std::string(1, "lmr"[i]) : std::to_string(i);
      if (parameter.finger() != name) continue;
      *value = values[i];
      return true;
    }
    return false;
  }
  *value = values[0];
  return true;
}

void JudgeValues(const v1::Step& step, const Hidden& truth, const Scenario& scenario,
                 std::vector<Mark>* marks) {
  // surface_error competes with the effects; its length is not an estimate of anything.
  if (step.effect() != truth.effect || truth.effect == "surface_error") return;
  bool near = step.parameters_size() > 0;
  for (const v1::ParameterValue& parameter : step.parameters()) {
    double value = 0;
    if (!TrueValue(parameter, truth, scenario, &value)) {
      near = false;
      continue;
    }
    near &= std::abs(parameter.value() - value) <= 3 * parameter.std_error();
    marks->push_back({"interval covers", parameter.lower() <= value && value <= parameter.upper()});
  }
  marks->push_back({"within 3 standard errors", near});
}

void JudgeEffects(const Arm& arm, const Scenario& truth, const v1::Report& report, std::vector<Mark>* marks) {
  // Each hidden effect takes one step.
  std::vector<const v1::Step*> taken;
  int found = 0;
  bool all_quiet = true;
  for (const Hidden& hidden : truth.hidden) {
    for (const v1::Step& step : report.steps()) {
      if (std::count(taken.begin(), taken.end(), &step) || !Names_(step, hidden, truth)) continue;
      taken.push_back(&step), ++found;
      JudgeValues(step, hidden, truth, marks);
      break;
    }
    all_quiet &= hidden.effect != "surface_error";
  }
  bool added = false;
  for (const v1::Step& step : report.steps())
    added |= std::count(taken.begin(), taken.end(), &step) == 0 && !Contains(arm.tolerated, step.effect());

  const bool first_is_right =
      report.steps_size() > 0 &&
      std::any_of(truth.hidden.begin(), truth.hidden.end(),
                  [&](const Hidden& hidden) { return Names_(report.steps(0), hidden, truth); });
  bool named = true;
  for (const Hidden& hidden : truth.hidden) {
    bool here = false;
    for (const v1::Step& step : report.steps())
      here |= step.effect() == hidden.effect || Contains(EquivalentsOf(step), hidden.effect);
    named &= here;
  }
  marks->push_back({"right first", first_is_right});
  marks->push_back({"truth named", named});
  marks->push_back({"all found, none added", found == static_cast<int>(truth.hidden.size()) && !added});
  marks->push_back({"none added", !added});
  marks->push_back({"says missing effects", report.verdict() == v1::Report::MISSING_EFFECTS});
  if (all_quiet)
    marks->push_back(
        {"rmse at the floor", TouchEntry(report).final().rmse() <= 1.05 * TouchEntry(report).noise_floor()});
}

void JudgeAmbiguity(const Scenario& truth, const v1::Report& report, std::vector<Mark>* marks) {
  const Hidden& hidden = truth.hidden.front();
  Names wanted = EquivalentEffects(hidden, truth);
  wanted.push_back(hidden.effect);
  bool said = false, decided = false;
  for (const v1::Step& step : report.steps()) {
    Names together = EquivalentsOf(step);
    together.push_back(step.effect());
    said |=
        std::all_of(wanted.begin(), wanted.end(), [&](const auto& name) { return Contains(together, name); });
    decided |= !step.discriminating_measurement().empty();
  }
  for (const v1::Ambiguity& ambiguity : report.ambiguities())
    decided |= !ambiguity.discriminating_measurement().empty();
  marks->push_back({"said so", said});
  marks->push_back({"said so, with what decides", said && decided});
  marks->push_back({"one step", report.steps_size() == 1});
}

void JudgeUnlisted(const Scenario& truth, const v1::Report& report, double formula_cuts_to,
                   std::vector<Mark>* marks) {
  const bool owned_up = report.verdict() == v1::Report::UNEXPLAINED;
  marks->push_back({"unexplained", owned_up});
  marks->push_back({"wrong name instead", !owned_up && report.steps_size() > 0});
  const auto& right = FindUnlisted(truth.unlisted.front().name).covariates;
  const auto& covariates = TouchEntry(report).unexplained().covariates();
  marks->push_back({"right covariate first", covariates.size() > 0 && Contains(right, covariates[0].name())});
  marks->push_back({"formula halves the misfit", formula_cuts_to <= 0.5});
}

// Questions that a list of names answers.
bool IsAboutNames(const std::string& measure) {
  for (const char* known : {"false claim", "right first", "truth named", "all found, none added",
                            "none added", "wrong name instead"})
    if (measure == known) return true;
  return false;
}

std::string Number(double value) {
  char text[32];
  snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// The distribution differs, or repeats show something; then the truth must be among what would do it.
void JudgeNoPoses(const Scenario& truth, const v1::Report& report, std::vector<Mark>* marks) {
  const v1::DistributionComparison& distributions = TouchEntry(report).distributions();
  const bool found = distributions.p() < 0.01 || distributions.findings_size() > 0;
  marks->push_back({truth.hidden.empty() ? "false detection" : "detects", found});
  if (truth.hidden.empty() || distributions.findings().empty()) return;
  bool named = false;
  for (const v1::RepeatFinding& finding : distributions.findings())
    for (const std::string& effect : finding.compatible_effects()) named |= effect == truth.hidden[0].effect;
  marks->push_back({"truth among what repeats allow", named});
}

}  // namespace

const v1::DataReport& TouchEntry(const v1::Report& report) {
  return report.data().empty() ? v1::DataReport::default_instance() : report.data(0);
}

std::string KindOf(const v1::DataProblem& problem) {
  std::string name = v1::DataProblem::Kind_Name(problem.kind());
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

std::vector<Mark> Judge(const Arm& arm, const Scenario& truth, const v1::Report& report,
                        double formula_cuts_to) {
  std::vector<Mark> marks;
  Kind kind = arm.kind;
  if (kind == Kind::kEffects && truth.hidden.empty()) kind = Kind::kNothing;
  switch (kind) {
    case Kind::kNothing: {
      // Gross errors of more than one touch in a hundred are in the data, and no noise of the model explains them.
      const bool gross_errors = truth.outlier_share > 0.01;
      const bool unexplained = report.verdict() == v1::Report::UNEXPLAINED;
      bool claim = (unexplained && !gross_errors) || report.verdict() == v1::Report::WRONG_VALUES;
      if (gross_errors) marks.push_back({"owns up to gross errors", unexplained || report.steps_size() > 0});
      for (const v1::Step& step : report.steps()) claim |= !Contains(arm.tolerated, step.effect());
      marks.push_back({"false claim", claim});
      break;
    }
    case Kind::kEffects:
      JudgeEffects(arm, truth, report, &marks);
      break;
    case Kind::kIndistinguishable:
      JudgeAmbiguity(truth, report, &marks);
      break;
    case Kind::kUnlisted:
      JudgeUnlisted(truth, report, formula_cuts_to, &marks);
      break;
    case Kind::kNoPoses:
      marks.push_back({"names a culprit", report.steps_size() > 0});
      JudgeNoPoses(truth, report, &marks);
      break;
    case Kind::kWrongValue: {
      bool value_right = false;
      for (const v1::Refit& refit : report.refitted())
        for (const v1::ParameterValue& parameter : refit.parameters())
          value_right |= refit.effect() == truth.hidden[0].effect &&
                         std::abs(parameter.value() - truth.hidden[0].values[0]) <= 3 * parameter.std_error();
      marks.push_back({"says wrong values", report.verdict() == v1::Report::WRONG_VALUES});
      marks.push_back({"value right", value_right});
      break;
    }
    case Kind::kNoiseMissing: {
      bool named = report.steps_size() == 1 && report.steps(0).effect() == "gaussian_noise", sized = false;
      if (named)
        for (const v1::ParameterValue& parameter : report.steps(0).parameters())
          sized |= std::abs(parameter.value() / truth.sigma_us - 1) < 0.05;
      marks.push_back({"noise named", named});
      marks.push_back({"noise within 5 %", sized});
      bool agree = TouchEntry(report).histograms_size() > 0;
      for (const v1::Histogram& histogram : TouchEntry(report).histograms())
        agree &= histogram.p_improved() > 0.001;
      marks.push_back({"histograms agree", agree});
      break;
    }
    case Kind::kCause:
    case Kind::kBeyondBound:
    case Kind::kBadPrint:
    case Kind::kOldValue:
    case Kind::kWrongNoise:
    case Kind::kDataError:
    case Kind::kTooFew:
      break;  // only the figures of figures.h
  }
  return marks;
}

std::vector<Mark> JudgeNames(const Arm& arm, const Scenario& truth, const Names& names) {
  v1::Report report;
  for (const std::string& name : names) {
    v1::Step* step = report.add_steps();
    step->set_effect(name);
    // For methods that report no equivalents, exact equivalents count as right.
    for (const Hidden& hidden : truth.hidden)
      if (Contains(EquivalentEffects(hidden, truth), name)) step->add_equivalent(hidden.effect);
  }
  report.set_verdict(names.empty() ? v1::Report::ADEQUATE : v1::Report::MISSING_EFFECTS);
  std::vector<Mark> marks;
  for (const Mark& mark : Judge(arm, truth, report, NAN))
    if (IsAboutNames(mark.measure)) marks.push_back(mark);
  return marks;
}

std::string TruthInWords(const Scenario& truth) {
  std::string words;
  const auto add = [&](const std::string& name, const std::vector<double>& values) {
    words += (words.empty() ? "" : "; ") + name;
    for (const double value : values) words += " " + Number(value);
  };
  for (const Hidden& hidden : truth.hidden) add(hidden.effect, hidden.values);
  for (const Unlisted& unlisted : truth.unlisted)
    add("unlisted " + unlisted.name, {unlisted.k_mm, unlisted.second});
  for (const Cause& cause : truth.causes) add(InWords(cause), {});
  for (const DataError& data_error : truth.data_errors) add("mistake: " + InWords(data_error), {});
  for (const Hidden& given : truth.in_model) add("in the model: " + given.effect, given.values);
  return words.empty() ? "nothing" : words;
}

std::string ReportInWords(const v1::Report& report) {
  std::string words = v1::Report::Verdict_Name(report.verdict());
  const auto add_values = [&](const auto& parameters) {
    for (const v1::ParameterValue& p : parameters)
      words += " " + p.name() + (p.object().empty() ? "" : "(" + p.object() + ")") +
               (p.finger().empty() ? "" : "[" + p.finger() + "]") + "=" + Number(p.value()) + "+-" +
               Number(p.std_error());
  };
  for (const v1::Step& step : report.steps()) {
    words += "; " + step.effect();
    if (step.equivalent_size() > 0) {
      words += " [or";
      for (const std::string& name : step.equivalent()) words += " " + name;
      words += "]";
    }
    words += " P=" + Number(step.probability()) + (step.words().empty() ? "" : " (" + step.words() + ")");
    add_values(step.parameters());
  }
  for (const v1::Refit& refit : report.refitted()) {
    words += "; refitted " + refit.effect();
    add_values(refit.parameters());
  }
  if (const v1::DataReport& data = TouchEntry(report); data.has_unexplained()) {
    words += "; unexplained:";
    for (const v1::CovariateTest& test : data.unexplained().covariates()) {
      words += " " + test.name();
      if (&test == &data.unexplained().covariates(std::min(2, data.unexplained().covariates_size() - 1)))
        break;
    }
    words += " formula '" + data.unexplained().formula() + "'";
    if (!data.unexplained().lookup_yaml().empty()) words += " with a lookup";
  }
  for (const v1::DataProblem& problem : report.data_problems())
    words += "; check data: " + KindOf(problem) + " " + problem.detail();
  for (const std::string& effect : report.superfluous()) words += "; superfluous " + effect;
  const v1::DataReport& data = TouchEntry(report);
  words += "; rmse " + Number(data.initial().rmse()) + " -> " + Number(data.final().rmse()) + " floor " +
           Number(data.noise_floor()) + " us, p " + Number(data.final().lack_of_fit_p());
  return words;
}

}  // namespace touchstone::hidden
