// Formula: an effect that the user writes in the model file, without building anything.
//   adds: travel_mm   pose, contact, motion: the finger travels that much more; sensor: the same, as time
//   adds: time_us     sensor: the finger reports that much later
//   adds: grey        image sensor: the pixel of a photograph is recorded that much brighter
// A finger without contact gets nothing. A value that is not finite is an error of the whole batch
// (TouchBatch::formula_error), not a silent hole in the data.
#include "server/effects/formula/formula.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/formula/formula_program.h"
#include "server/effects/formula/pixel_variables.h"
#include "server/effects/formula/user_term.h"
#include "server/model/fields/user_term_fields.h"

namespace touchstone::effects {

// The catalogue's entry, which only describes; MakeFormulaEffect makes effects that act.
model::Effect Formula() {
  model::Effect effect;
  effect.name = "formula";
  effect.stage = model::Stage::kMotion;
  effect.meaning =
      "An effect of your own: an expression over the touch that adds travel_mm or time_us to each finger, or "
      "grey to each pixel of a photograph. It needs a name, an expression and its parameters.";
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
  std::string covariate;                                  // a cov_* column, else
  double (*read_pixel)(const PhotoPixel&) = nullptr;      // a variable of photographs
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
    columns[i] = ColumnOf(input.covariate, absl::StrCat("formula '", spec.name, "'"), &touches);
    if (columns[i] == nullptr) return;
  }

  AddToFingers(spec, &touches, [&](int finger, int touch, double* added) {
    for (size_t i = 0; i < formula.inputs.size(); ++i) {
      if (columns[i] != nullptr)
        inputs[i] = columns[i][touch];
      else if (formula.inputs[i].read != nullptr)
        inputs[i] = formula.inputs[i].read(touches, finger, touch);
    }
    *added = evaluator->Value();
    if (std::isfinite(*added)) return true;
    touches.formula_error = DescribeFailure(formula, touches, finger, touch, inputs, *added);
    return false;
  });
}

// A formula that one thread evaluates pixel by pixel.
std::function<double(const PhotoPixel&)> PixelFormula(std::shared_ptr<const CompiledFormula> formula,
                                                      absl::Span<const double> values) {
  const auto evaluator = std::make_shared<FormulaProgram::Loan>(*formula->program);
  for (size_t i = 0; i < formula->inputs.size(); ++i) {
    const int parameter = formula->inputs[i].parameter;
    if (parameter >= 0)
      (*evaluator)->inputs()[i] = FromSi(formula->spec->parameters[parameter].unit, values[parameter]);
  }
  // The program is lent for as long as the function lives.
  return [formula = std::move(formula), evaluator](const PhotoPixel& pixel) {
    double* inputs = (*evaluator)->inputs();
    for (size_t i = 0; i < formula->inputs.size(); ++i)
      if (formula->inputs[i].read_pixel != nullptr) inputs[i] = formula->inputs[i].read_pixel(pixel);
    return (*evaluator)->Value();
  };
}

bool IsPlainName(const std::string& name) {
  if (name.empty() || name.size() > 64 || !(absl::ascii_isalpha(name[0]) || name[0] == '_')) return false;
  return std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '_'; });
}

// Whether expressions know the name already.
bool IsTaken(const std::string& name, bool of_photos) {
  const auto same = [&](const auto& word) { return name == word.name; };
  if (of_photos && FindPixelVariable(name) != nullptr) return true;
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
    if (IsTaken(name, spec.adds_grey))
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
  std::vector<std::string> parameters;
  for (const model::ParameterInfo& parameter : spec.parameters) parameters.push_back(parameter.name);
  for (const UsedName& name : formula->program->names()) {
    Input input;
    for (size_t p = 0; p < spec.parameters.size(); ++p)
      if (spec.parameters[p].name == name.name) input.parameter = static_cast<int>(p);
    if (input.parameter >= 0) {
      used[input.parameter] = true;
    } else if (spec.adds_grey) {
      const auto variable = FindPixelInput("formula", name.name, parameters);
      if (!variable.ok())
        return absl::InvalidArgumentError(
            absl::StrCat("character ", name.character, ": ", variable.status().message()));
      input.read_pixel = (*variable)->read;
    } else {
      const auto variable = FindInput("formula", spec, name.name, parameters);
      if (!variable.ok())
        return absl::InvalidArgumentError(
            absl::StrCat("character ", name.character, ": ", variable.status().message()));
      if (*variable != nullptr) input.read = (*variable)->read;
      if (*variable == nullptr) input.covariate = name.name;
      AddNeedsOf(name.name, needs);
    }
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
  TOUCHSTONE_RETURN_IF_ERROR(CheckAdds(spec));
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
  effect->meaning = absl::StrCat("Adds ", model::AddsName(spec), " = ", spec.expression, ".");
  effect->formula = formula->spec;
  for (size_t i = 0; i < spec.parameters.size(); ++i) {
    model::ParameterInfo parameter = spec.parameters[i];
    parameter.neutral = spec.values[i];
    parameter.typical = (parameter.upper - parameter.lower) / 4;
    effect->parameters.push_back(std::move(parameter));
  }
  if (spec.adds_grey) {
    effect->apply = nullptr;
    effect->apply_to_photo = [formula = std::shared_ptr<const CompiledFormula>(std::move(formula))](
                                 absl::Span<const double> values, PhotoSettings& photo) {
      photo.added_grey.push_back(PixelFormula(formula, values));
    };
    return std::shared_ptr<const model::Effect>(std::move(effect));
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
