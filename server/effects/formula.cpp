// Formula: an effect that the user writes in the model file, without building anything.
//   adds: travel_mm   pose, contact, motion: the finger travels that much more; sensor: the same, as time
//   adds: time_us     sensor: the finger reports that much later
// A finger without contact gets nothing. A value that is not finite is an error of the whole batch
// (TouchBatch::formula_error), not a silent hole in the data.
#include "server/effects/formula.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/effects/formula_program.h"

namespace touchstone::effects {

// The catalogue's entry, which only describes; MakeFormulaEffect makes effects that act.
model::Effect Formula() {
  model::Effect effect;
  effect.name = "formula";
  effect.stage = model::Stage::kMotion;
  effect.meaning =
      "An effect of your own: an expression over the touch that adds travel_mm or time_us to each finger. It "
      "needs a name, an expression and its parameters.";
  effect.signature =
      "What the expression says. The diagnosis suggests one where no built-in effect explains the error.";
  effect.check_on_rig = "Change the one quantity that the expression depends on and hold the rest.";
  effect.remedy = "Find the cause behind the formula; then give the cause a built-in effect, or remove it.";
  effect.apply = [](absl::Span<const double>, TouchBatch&) {};
  return effect;
}

namespace {

// Where the value of a name comes from, for one input of the program.
struct Input {
  int parameter = -1;                                     // index of a parameter, else
  double (*read)(const TouchBatch&, int, int) = nullptr;  // a variable, else
  std::string covariate;                                  // a cov_* column
};

struct CompiledFormula {
  std::shared_ptr<const model::FormulaSpec> spec;
  std::shared_ptr<const FormulaProgram> program;
  std::vector<Input> inputs;
};

// "nan for touch 17, finger 2 (travel_mm = 12.5, k = 0)".
std::string DescribeFailure(const CompiledFormula& formula, const TouchBatch& touches, int finger, int touch,
                            const double* inputs, double value) {
  std::vector<std::string> shown;
  const std::vector<UsedName>& names = formula.program->names();
  for (size_t i = 0; i < names.size(); ++i)
    shown.push_back(absl::StrCat(names[i].name, " = ", ShortestNumber(inputs[i])));
  return absl::StrCat("formula '", formula.spec->name, "' gives ", ShortestNumber(value), " for touch ",
                      touches.index[touch], ", finger ", finger, shown.empty() ? "" : " (",
                      absl::StrJoin(shown, ", "), shown.empty() ? "" : ")", ": \"", formula.spec->expression,
                      "\"");
}

// The array that the formula adds to.
std::vector<double>& Target(const model::FormulaSpec& spec, TouchBatch& touches) {
  if (spec.stage == model::Stage::kPose) return touches.travel_offset_m;
  return spec.stage == model::Stage::kSensor ? touches.reported_time_s : touches.travel_m;
}

void ApplyFormula(const CompiledFormula& formula, absl::Span<const double> values, TouchBatch& touches) {
  if (!touches.formula_error.empty()) return;
  const model::FormulaSpec& spec = *formula.spec;
  FormulaProgram::Loan evaluator(*formula.program);
  double* inputs = evaluator->inputs();

  // Parameters are the same for all fingers; columns are looked up once.
  std::vector<const double*> columns(formula.inputs.size(), nullptr);
  for (size_t i = 0; i < formula.inputs.size(); ++i) {
    const Input& input = formula.inputs[i];
    if (input.parameter >= 0)
      inputs[i] = FromSi(spec.parameters[input.parameter].unit, values[input.parameter]);
    if (input.covariate.empty()) continue;
    const auto column = touches.covariates.find(input.covariate);
    if (column == touches.covariates.end()) {
      touches.formula_error = absl::StrCat("formula '", spec.name, "' needs the column ", input.covariate,
                                           ", which these touches do not have");
      return;
    }
    columns[i] = column->second.data();
  }

  std::vector<double>& target = Target(spec, touches);
  const bool needs_contact = spec.stage != model::Stage::kPose;
  const double si_factor = spec.adds_time ? kSecondsPerMicrosecond : kMetresPerMillimetre;
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    for (int touch = 0; touch < touches.size(); ++touch) {
      const int entry = touches.At(finger, touch);
      if (needs_contact && std::isnan(touches.travel_m[entry])) continue;
      for (size_t i = 0; i < formula.inputs.size(); ++i) {
        if (columns[i] != nullptr)
          inputs[i] = columns[i][touch];
        else if (formula.inputs[i].read != nullptr)
          inputs[i] = formula.inputs[i].read(touches, finger, touch);
      }
      const double value = evaluator->Value();
      if (!std::isfinite(value)) {
        touches.formula_error = DescribeFailure(formula, touches, finger, touch, inputs, value);
        return;
      }
      double added = value * si_factor;
      if (spec.stage == model::Stage::kSensor && !spec.adds_time) added *= touches.time_per_travel_s_m[entry];
      target[entry] += added;
    }
  }
}

bool IsPlainName(const std::string& name) {
  if (name.empty() || name.size() > 64 || !(absl::ascii_isalpha(name[0]) || name[0] == '_')) return false;
  return std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '_'; });
}

// Whether expressions know the name already.
bool IsTaken(const std::string& name) {
  const auto same = [&](const auto& word) { return name == word.name; };
  const auto variables = FormulaVariables();
  const auto functions = FormulaFunctions();
  const auto constants = FormulaConstants();
  return std::any_of(variables.begin(), variables.end(), same) ||
         std::any_of(functions.begin(), functions.end(), same) ||
         std::any_of(constants.begin(), constants.end(), same) || absl::StartsWith(name, "cov_");
}

absl::Status CheckParameters(const model::FormulaSpec& spec) {
  if (spec.parameters.size() > kMaxFormulaParameters)
    return absl::InvalidArgumentError(absl::StrCat("it has ", spec.parameters.size(), " parameters; at most ",
                                                   kMaxFormulaParameters, " are taken"));
  if (spec.values.size() != spec.parameters.size())
    return absl::InvalidArgumentError(absl::StrCat("it has ", spec.parameters.size(), " parameters and ",
                                                   spec.values.size(), " values; every parameter needs one"));
  for (size_t i = 0; i < spec.parameters.size(); ++i) {
    const model::ParameterInfo& parameter = spec.parameters[i];
    const std::string& name = parameter.name;
    if (!IsPlainName(name))
      return absl::InvalidArgumentError(absl::StrCat(
          "parameter '", name, "': a name has letters, digits and '_', and starts with a letter"));
    if (IsTaken(name))
      return absl::InvalidArgumentError(absl::StrCat(
          "parameter '", name, "': the name belongs to a variable, function or constant; take another"));
    for (size_t j = 0; j < i; ++j)
      if (spec.parameters[j].name == name)
        return absl::InvalidArgumentError(absl::StrCat("parameter '", name, "' is declared twice"));
    if (!(std::isfinite(parameter.lower) && std::isfinite(parameter.upper) &&
          parameter.lower < parameter.upper))
      return absl::InvalidArgumentError(absl::StrCat("parameter '", name, "': min (",
                                                     ShortestNumber(parameter.lower), ") must be below max (",
                                                     ShortestNumber(parameter.upper), ")"));
    if (!(spec.values[i] >= parameter.lower && spec.values[i] <= parameter.upper))
      return absl::InvalidArgumentError(
          absl::StrCat("parameter '", name, "': value ", ShortestNumber(spec.values[i]), " must lie in ",
                       ShortestNumber(parameter.lower), " to ", ShortestNumber(parameter.upper), " ",
                       UnitSymbol(parameter.unit)));
  }
  return absl::OkStatus();
}

// Finds what each name of the expression means in the formula's stage.
absl::Status Resolve(const model::FormulaSpec& spec, CompiledFormula* formula, model::EffectNeeds* needs) {
  std::vector<bool> used(spec.parameters.size(), false);
  for (const UsedName& name : formula->program->names()) {
    const auto wrong = [&](absl::string_view what) {
      return absl::InvalidArgumentError(absl::StrCat("character ", name.character, ": ", what));
    };
    Input input;
    for (size_t p = 0; p < spec.parameters.size(); ++p)
      if (spec.parameters[p].name == name.name) input.parameter = static_cast<int>(p);
    std::vector<std::string> known;
    for (const FormulaVariable& variable : FormulaVariables()) {
      known.push_back(variable.name);
      if (name.name != variable.name) continue;
      if (variable.since > spec.stage)
        return wrong(absl::StrCat(name.name, " is known from the ", model::StageName(variable.since),
                                  " stage on, and this formula acts in the ", model::StageName(spec.stage),
                                  " stage"));
      input.read = variable.read;
    }
    if (input.parameter >= 0) {
      used[input.parameter] = true;
    } else if (absl::StartsWith(name.name, "cov_") && name.name.size() > 4) {
      input.covariate = name.name;
      needs->covariates.push_back(name.name);
    } else if (input.read == nullptr) {
      for (const model::ParameterInfo& parameter : spec.parameters) known.push_back(parameter.name);
      return wrong(absl::StrCat("unknown variable '", name.name, "'", DidYouMean(name.name, known)));
    }
    needs->curvature |= name.name == "curvature_per_m";
    needs->previous_press |= name.name == "previous_press_mm";
    needs->session_time |= name.name == "session_time_s" || name.name == "pause_s";
    formula->inputs.push_back(std::move(input));
  }
  for (size_t p = 0; p < used.size(); ++p)
    if (!used[p])
      return absl::InvalidArgumentError(
          absl::StrCat("parameter '", spec.parameters[p].name, "' is not used; use it or leave it out"));
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const model::Effect>> Make(const model::FormulaSpec& spec) {
  if (!IsPlainName(spec.name))
    return absl::InvalidArgumentError("a name has letters, digits and '_', and starts with a letter");
  if (spec.adds_time && spec.stage != model::Stage::kSensor)
    return absl::InvalidArgumentError(
        absl::StrCat("time_us can be added in the sensor stage only, not in the ",
                     model::StageName(spec.stage), " stage; there add travel_mm"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckParameters(spec));

  auto formula = std::make_shared<CompiledFormula>();
  formula->spec = std::make_shared<const model::FormulaSpec>(spec);
  absl::StatusOr<std::shared_ptr<const FormulaProgram>> program = FormulaProgram::Compile(spec.expression);
  auto effect = std::make_shared<model::Effect>(Formula());
  absl::Status resolved = program.status();
  if (resolved.ok()) {
    formula->program = *std::move(program);
    resolved = Resolve(spec, formula.get(), &effect->needs);
  }
  if (!resolved.ok())
    return absl::InvalidArgumentError(
        absl::StrCat("expression \"", spec.expression, "\", ", resolved.message()));

  effect->stage = spec.stage;
  effect->meaning =
      absl::StrCat("Adds ", spec.adds_time ? "time_us" : "travel_mm", " = ", spec.expression, ".");
  effect->formula = formula->spec;
  for (size_t i = 0; i < spec.parameters.size(); ++i) {
    model::ParameterInfo parameter = spec.parameters[i];
    parameter.neutral = spec.values[i];
    parameter.typical = (parameter.upper - parameter.lower) / 4;
    effect->parameters.push_back(std::move(parameter));
  }
  effect->apply = [formula = std::shared_ptr<const CompiledFormula>(std::move(formula))](
                      absl::Span<const double> values, TouchBatch& touches) {
    ApplyFormula(*formula, values, touches);
  };
  return std::shared_ptr<const model::Effect>(std::move(effect));
}

}  // namespace

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeFormulaEffect(const model::FormulaSpec& spec) {
  absl::StatusOr<std::shared_ptr<const model::Effect>> effect = Make(spec);
  if (effect.ok()) return effect;
  return absl::InvalidArgumentError(absl::StrCat("formula '", spec.name, "': ", effect.status().message()));
}

}  // namespace touchstone::effects
