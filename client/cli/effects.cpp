// touchstone effects: the catalogue, and what one effect is.
#include "client/cli/common/common.h"
#include "client/cli/common/terminal.h"
#include "client/workbench_server/formula_words.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/formula/formula.h"
#include "server/effects/formula/pixel_variables.h"

namespace touchstone::cli {
namespace {

constexpr size_t kIndent = 12;

std::string WithUnit(double value, const std::string& unit) {
  return unit.empty() ? ShortestNumber(value) : absl::StrCat(ShortestNumber(value), " ", unit);
}

std::string ArityInWords(const v1::Parameter& parameter) {
  if (parameter.arity() == v1::PARAMETER_ARITY_VECTOR3) return "x,y,z";
  if (parameter.arity() == v1::PARAMETER_ARITY_VECTOR2) return "x,y in the image";
  if (parameter.arity() == v1::PARAMETER_ARITY_PER_FINGER)
    return parameter.sum_zero() ? "one per finger, sum 0" : "one per finger";
  return "one number";
}

std::string ArityWord(v1::ParameterArity arity) {
  switch (arity) {
    case v1::PARAMETER_ARITY_SCALAR:
      return "scalar";
    case v1::PARAMETER_ARITY_VECTOR3:
      return "vector3";
    case v1::PARAMETER_ARITY_VECTOR2:
      return "vector2";
    case v1::PARAMETER_ARITY_PER_FINGER:
      return "finger";
    default:
      return "unknown";
  }
}

std::string StageWord(v1::EffectStage stage) {
  switch (stage) {
    case v1::EFFECT_STAGE_POSE:
      return "pose";
    case v1::EFFECT_STAGE_CONTACT:
      return "contact";
    case v1::EFFECT_STAGE_MOTION:
      return "motion";
    case v1::EFFECT_STAGE_SENSOR:
      return "sensor";
    case v1::EFFECT_STAGE_CAMERA_POSE:
      return "camera pose";
    case v1::EFFECT_STAGE_PROJECTION:
      return "projection";
    case v1::EFFECT_STAGE_SHADING:
      return "shading";
    case v1::EFFECT_STAGE_IMAGE_SENSOR:
      return "image sensor";
    default:
      return "unknown";
  }
}

Json EffectJson(const v1::Effect& effect) {
  Json parameters = Json::array();
  for (const v1::Parameter& p : effect.parameters())
    parameters.push_back({{"name", p.name()},
                          {"unit", p.unit()},
                          {"arity", ArityWord(p.arity())},
                          {"min", p.min()},
                          {"max", p.max()},
                          {"default", p.default_value()},
                          {"typical", p.typical()},
                          {"sum_zero", p.sum_zero()},
                          {"meaning", p.meaning()}});
  return {{"name", effect.name()},
          {"stage", StageWord(effect.stage())},
          {"meaning", effect.meaning()},
          {"signature", effect.signature()},
          {"check_on_rig", effect.check_on_rig()},
          {"remedy", effect.remedy()},
          {"parameters", parameters}};
}

std::string Paragraph(const std::string& title, const std::string& text) {
  std::string line = title;
  line.append(line.size() < kIndent ? kIndent - line.size() : 1, ' ');
  return line + Wrap(text, TextWidth(), kIndent) + "\n";
}

// What an expression may use: the table that the formula's compiler reads.
std::string FormulaHelp() {
  Table variables({"VARIABLE", "UNIT", "SINCE STAGE", "MEANING"});
  for (const effects::FormulaVariable& variable : effects::FormulaVariables())
    variables.Add({variable.name, variable.unit[0] == '\0' ? "-" : variable.unit,
                   model::StageName(variable.since), variable.meaning});
  variables.Add({"cov_NAME", "-", "pose", "the column cov_NAME of the measurements"});
  Table pixel_variables({"VARIABLE", "UNIT", "MEANING"});
  for (const effects::PixelVariable& variable : effects::PixelVariables())
    pixel_variables.Add({variable.name, variable.unit[0] == '\0' ? "-" : variable.unit, variable.meaning});
  Table functions({"FUNCTION", "MEANING"});
  for (const effects::FormulaWord& word : effects::FormulaFunctions())
    functions.Add({word.usage, word.meaning});
  for (const effects::FormulaWord& word : effects::FormulaConstants())
    functions.Add({word.usage, word.meaning});
  return absl::StrCat(
      "\nIn an expression:\n\n", variables.Text(),
      "\nIn one that adds grey to each pixel of a photograph:\n\n", pixel_variables.Text(), "\n",
      functions.Text(),
      "\nAn expression for travel_mm may use what its stage and earlier ones know.\n"
      "For instance:\n"
      "  touchstone model add nominal formula name=lead_screw adds=travel_mm \\\n"
      "    'expression=k * sin(2*pi*travel_mm/lead)' k=0.1 k_unit=mm lead=4 lead_unit=mm -o screw.yaml\n"
      "  touchstone model add nominal formula name=glare adds=grey 'expression=k*radius^2' k=4 k_unit=grey "
      "\\\n"
      "    k_min=-20 k_max=20 -o glare.yaml\n");
}

constexpr char kLookupHelp[] =
    "\nA model file has it as\n\n"
    "  - lookup:\n"
    "      name: warm_up\n"
    "      adds: time_us                  # or travel_mm; grey for photographs\n"
    "      covariate: session_time_s      # any variable of `touchstone effects formula`, or a cov_* column\n"
    "      knots: [0, 300, 900]           # rising, in the covariate's unit\n"
    "      values: {l: [0, 2100, 4000], m: [0, 0, 0], r: [0, -2100, -4000]}   # or one list for every "
    "finger\n\n"
    "Linear between knots, constant beyond. `touchstone diagnose` prints such a block where something "
    "depends on a\n"
    "covariate and has no name yet.\n\n"
    "  touchstone model add nominal lookup name=warm_up adds=time_us covariate=session_time_s \\\n"
    "    knots=0,300,900 l=0,2100,4000 m=0,0,0 r=0,-2100,-4000 -o warm.yaml\n";

constexpr char kSurfaceMapHelp[] =
    "\nA model file has it as\n\n"
    "  - surface_map: {file: better.surface.csv}   # relative to the model file's folder\n\n"
    "and the map is a CSV file with the columns object, x_mm, y_mm, z_mm (a place on the mesh), departure_mm "
    "(along "
    "the\n"
    "outward normal), std_dev_mm, length_mm and rms_mm; between its points it is interpolated "
    "(server/model/surface_map.md).\n\n"
    "  touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --save-model better.yaml "
    "--with-surface-map\n"
    "  touchstone model add nominal.yaml surface_map file=scan.csv -o scanned.yaml\n"
    "  touchstone mesh correct lat00.off --map better.surface.csv -o lat00_measured.off\n";

absl::Status Explain(const Cli& cli, const v1::Effect& effect) {
  if (cli.output().json) {
    Json json = EffectJson(effect);
    if (effect.name() == "formula") json.update(workbench::FormulaWords());
    PrintJson(json);
    return absl::OkStatus();
  }
  std::string text = absl::StrCat(effect.name(), "  (stage: ", StageWord(effect.stage()), ")\n\n");
  text += Paragraph("What it is", effect.meaning());
  text += Paragraph("It shows as", effect.signature());
  text += Paragraph("Check", effect.check_on_rig());
  text += Paragraph("Remedy", effect.remedy());
  if (effect.parameters_size() > 0) {
    Table table({"PARAMETER", "VALUES", "MIN", "MAX", "DEFAULT", "TYPICAL", "MEANING"});
    for (const v1::Parameter& p : effect.parameters())
      table.Add({p.name(), ArityInWords(p), WithUnit(p.min(), p.unit()), WithUnit(p.max(), p.unit()),
                 WithUnit(p.default_value(), p.unit()), WithUnit(p.typical(), p.unit()), p.meaning()});
    absl::StrAppend(&text, "\n", table.Text());
    const v1::Parameter& first = effect.parameters(0);
    const std::string value =
        first.arity() == v1::PARAMETER_ARITY_SCALAR    ? ShortestNumber(first.typical())
        : first.arity() == v1::PARAMETER_ARITY_VECTOR2 ? absl::StrCat(ShortestNumber(first.typical()), ",0")
        : first.sum_zero()
            ? absl::StrCat(ShortestNumber(first.typical()), ",0,", ShortestNumber(-first.typical()))
            : absl::StrCat(ShortestNumber(first.typical()), ",0,0");
    absl::StrAppend(&text, "\nAdd it:  touchstone model add nominal ", effect.name(), " ", first.name(), "=",
                    value, " -o better.yaml\n");
  }
  if (effect.name() == "formula") text += FormulaHelp();
  if (effect.name() == "lookup") text += kLookupHelp;
  if (effect.name() == "surface_map") text += kSurfaceMapHelp;
  return cli.Print(text);
}

absl::Status RunEffects(const Cli& cli, const std::string& name) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListEffectsResponse response,
                              connection->Call(&v1::Models::Stub::ListEffects, v1::ListEffectsRequest()));
  if (!name.empty()) {
    std::vector<std::string> known;
    for (const v1::Effect& effect : response.effects()) {
      if (effect.name() == name) return Explain(cli, effect);
      known.push_back(effect.name());
    }
    return absl::NotFoundError(absl::StrCat("there is no effect '", name, "'", DidYouMean(name, known)));
  }
  if (cli.output().json) {
    Json list = Json::array();
    for (const v1::Effect& effect : response.effects()) list.push_back(EffectJson(effect));
    PrintJson({{"effects", list}});
    return absl::OkStatus();
  }
  Table table({"EFFECT", "STAGE", "PARAMETERS", "MEANING"});
  for (const v1::Effect& effect : response.effects()) {
    std::string parameters;
    for (const v1::Parameter& p : effect.parameters())
      absl::StrAppend(&parameters, parameters.empty() ? "" : ", ", p.name());
    table.Add({effect.name(), StageWord(effect.stage()), parameters, effect.meaning()});
  }
  return cli.Print(absl::StrCat(table.Text(), "\ntouchstone effects NAME explains one.\n"));
}

}  // namespace

void AddEffects(Cli* cli) {
  auto name = std::make_shared<std::string>();
  CLI::App* command = cli->AddCommand(
      nullptr, "effects", "Lists the physical effects that a model can have, or explains one.",
      "touchstone effects\n"
      "touchstone effects tip_radius\n"
      "touchstone effects formula          what an expression of your own may use\n"
      "touchstone effects --json",
      [cli, name] { return RunEffects(*cli, *name); });
  command->add_option("NAME", *name, "The effect to explain")->type_name("");
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
