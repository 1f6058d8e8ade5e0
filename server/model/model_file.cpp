// Reads a model file (format: model_file.md).
#include <absl/strings/ascii.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/model/fields/formula_fields.h"
#include "server/model/fields/lookup_fields.h"
#include "server/model/model.h"
#include "server/model/parameter_values.h"
#include "server/model/provenance.h"
#include "server/model/surface_map_file.h"
#include "server/model/yaml/yaml_tree.h"

namespace touchstone::model {
namespace {

using Kind = YamlNode::Kind;

class ModelReader {
 public:
  ModelReader(const std::string& origin, const EffectCatalogue& catalogue, const ModelFileReader& files)
      : origin_(origin), catalogue_(catalogue), files_(files) {}

  absl::StatusOr<Model> Read(const YamlNode& root) {
    TOUCHSTONE_RETURN_IF_ERROR(
        Want(root, Kind::kMap, "a model file", "touchstone: model/1, name: ..., effects: ..."));
    TOUCHSTONE_RETURN_IF_ERROR(
        CheckKeys(root, "a model file", {"touchstone", "name", "end_effector", "effects", "provenance"}));
    const YamlNode* format = root.Find("touchstone");
    if (format == nullptr)
      return Error(root, "the first line 'touchstone: model/1' is missing: is this a model file?");
    if (format->text != "model/1")
      return Error(*format, absl::StrCat("touchstone is '", format->text, "'; this program reads 'model/1'"));
    const YamlNode* name = root.Find("name");
    if (name == nullptr) return Error(root, "'name' is missing; write for example 'name: nominal'");
    TOUCHSTONE_ASSIGN_OR_RETURN(model_.name, Text(*name, "name"));
    TOUCHSTONE_RETURN_IF_ERROR(ReadEndEffector(root.Find("end_effector")));
    const YamlNode* effects = root.Find("effects");
    if (effects != nullptr && effects->kind != Kind::kNull) {
      TOUCHSTONE_RETURN_IF_ERROR(
          Want(*effects, Kind::kSequence, "effects", "one '- effect: {parameter: value}' a line"));
      for (const YamlNode& item : effects->items) TOUCHSTONE_RETURN_IF_ERROR(ReadEffect(item));
    }
    // It says nothing of the physics: whoever asks for it reads it (provenance.h).
    if (const YamlNode* provenance = root.Find("provenance"); provenance != nullptr)
      TOUCHSTONE_RETURN_IF_ERROR(ProvenanceOf(*provenance, origin_).status());
    return std::move(model_);
  }

 private:
  absl::Status Error(const YamlNode& node, absl::string_view message) const {
    return ErrorAt(origin_, node, message);
  }

  // An error that came without a place gets the node's.
  absl::Status At(const YamlNode& node, const absl::Status& status) const {
    return status.ok() ? status : Error(node, status.message());
  }

  absl::Status Want(const YamlNode& node, Kind kind, absl::string_view what,
                    absl::string_view example) const {
    if (node.kind == kind) return absl::OkStatus();
    YamlNode wanted;
    wanted.kind = kind;
    return Error(node,
                 absl::StrCat(what, " is ", node.KindInWords(),
                              node.text.empty() ? "" : absl::StrCat(" ('", node.text.substr(0, 40), "')"),
                              "; it must be ", wanted.KindInWords(), ": ", example));
  }

  absl::Status CheckKeys(const YamlNode& map, absl::string_view what,
                         const std::vector<std::string>& known) const {
    for (const YamlNode& key : map.keys)
      if (std::find(known.begin(), known.end(), key.text) == known.end())
        return Error(key, absl::StrCat(what, " has no '", key.text, "'", DidYouMean(key.text, known)));
    return absl::OkStatus();
  }

  absl::StatusOr<std::string> Text(const YamlNode& node, absl::string_view what) const {
    constexpr size_t kMaxBytes = 200;
    if (node.kind != Kind::kScalar || node.text.empty())
      return Error(node, absl::StrCat(what, " is ", node.KindInWords(), "; it must be a text"));
    if (node.text.size() > kMaxBytes)
      return Error(
          node, absl::StrCat(what, " has ", node.text.size(), " bytes; at most ", kMaxBytes, " are taken"));
    for (const unsigned char c : node.text)
      if (absl::ascii_iscntrl(c)) return Error(node, absl::StrCat(what, " must not have control characters"));
    return node.text;
  }

  absl::StatusOr<double> Number(const YamlNode& node, absl::string_view what,
                                const ParameterInfo& parameter = {}) const {
    if (node.kind != Kind::kScalar)
      return Error(node, absl::StrCat(what, " is ", node.KindInWords(), "; it must be a number"));
    absl::StatusOr<double> value = NumberFromText(parameter, node.text);
    if (!value.ok()) return Error(node, absl::StrCat(what, ": ", value.status().message()));
    return value;
  }

  absl::Status ReadEndEffector(const YamlNode* node) {
    if (node == nullptr) return absl::OkStatus();
    TOUCHSTONE_RETURN_IF_ERROR(Want(*node, Kind::kMap, "end_effector", "{fingers: 3, spacing_mm: 30}"));
    TOUCHSTONE_RETURN_IF_ERROR(CheckKeys(*node, "end_effector", {"fingers", "spacing_mm"}));
    if (const YamlNode* fingers = node->Find("fingers")) {
      if (fingers->kind != Kind::kScalar || !absl::SimpleAtoi(fingers->text, &model_.fingers))
        return Error(*fingers, absl::StrCat("end_effector.fingers is '", fingers->text,
                                            "'; it must be a whole number"));
      TOUCHSTONE_RETURN_IF_ERROR(At(*fingers, CheckRig(model_.fingers, 1)));
    }
    if (const YamlNode* spacing = node->Find("spacing_mm")) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const double spacing_mm, Number(*spacing, "end_effector.spacing_mm"));
      TOUCHSTONE_RETURN_IF_ERROR(At(*spacing, CheckRig(model_.fingers, spacing_mm)));
      model_.spacing_m = ToSi(Unit::kMillimetre, spacing_mm);
    }
    return absl::OkStatus();
  }

  absl::Status ReadEffect(const YamlNode& item) {
    if (item.kind != Kind::kMap || item.keys.size() != 1)
      return Error(item,
                   "an effect is written as '- effect: {parameter: value}', for example "
                   "'- gaussian_noise: {sigma_us: 5000}'");
    const YamlNode& key = item.keys[0];
    const YamlNode& body = item.items[0];
    const std::shared_ptr<const Effect> effect = catalogue_.Find(key.text);
    if (effect == nullptr) {
      std::vector<std::string> known;
      for (const auto& candidate : catalogue_.All()) known.push_back(candidate->name);
      return Error(key, absl::StrCat("unknown effect '", key.text, "'", DidYouMean(key.text, known)));
    }
    if (body.kind != Kind::kNull)
      TOUCHSTONE_RETURN_IF_ERROR(Want(body, Kind::kMap, key.text, "{parameter: value, ...}"));
    EffectInstance instance;
    if (effect->name == "formula") {
      TOUCHSTONE_RETURN_IF_ERROR(ReadFormula(key, body, &instance));
    } else if (effect->name == "lookup") {
      TOUCHSTONE_RETURN_IF_ERROR(ReadLookup(key, body, &instance));
    } else if (effect->name == "surface_map") {
      TOUCHSTONE_RETURN_IF_ERROR(ReadSurfaceMap(key, body, &instance));
    } else {
      instance.effect = effect;
      instance.values = effect->NeutralValues(model_.fingers);
      TOUCHSTONE_RETURN_IF_ERROR(ReadValues(body, *effect, {"scope", "objects"}, &instance.values));
    }
    TOUCHSTONE_RETURN_IF_ERROR(At(key, CheckAddition(model_, *instance.effect)));
    TOUCHSTONE_RETURN_IF_ERROR(ReadScope(body, &instance));
    model_.effects.push_back(std::move(instance));
    return absl::OkStatus();
  }

  // The parameters among the keys of `body`; those in `others` are someone else's.
  absl::Status ReadValues(const YamlNode& body, const Effect& effect, const std::vector<std::string>& others,
                          std::vector<double>* values) const {
    for (size_t k = 0; k < body.keys.size(); ++k) {
      const YamlNode& key = body.keys[k];
      const YamlNode& node = body.items[k];
      if (std::find(others.begin(), others.end(), key.text) != others.end()) continue;
      const absl::StatusOr<int> index = FindParameter(effect, key.text);
      if (!index.ok()) return Error(key, index.status().message());
      const ParameterInfo& parameter = effect.parameters[*index];
      const std::string what =
          absl::StrCat(effect.formula ? effect.formula->name : effect.name, ".", parameter.name);

      // A list for vectors and per-finger values, a single number else.
      std::vector<double> numbers;
      if (parameter.arity == Arity::kScalar) {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double number, Number(node, what, parameter));
        numbers.push_back(number);
      } else {
        TOUCHSTONE_RETURN_IF_ERROR(Want(node, Kind::kSequence, what, "[0, 0, 0]"));
        for (const YamlNode& entry : node.items) {
          TOUCHSTONE_ASSIGN_OR_RETURN(const double number, Number(entry, what));
          numbers.push_back(number);
        }
      }
      const absl::StatusOr<std::vector<double>> values_si =
          ValuesFromFile(what, parameter, numbers, model_.fingers);
      if (!values_si.ok()) return Error(node, values_si.status().message());
      std::copy(values_si->begin(), values_si->end(),
                values->begin() + ValueOffset(effect, *index, model_.fingers));
    }
    return absl::OkStatus();
  }

  absl::Status ReadScope(const YamlNode& body, EffectInstance* instance) const {
    const Effect& effect = *instance->effect;
    instance->per_object = effect.always_per_object;
    if (const YamlNode* scope = body.Find("scope")) {
      if (scope->text != "object" && scope->text != "rig")
        return Error(*scope, absl::StrCat("scope is '", scope->text, "'; it must be 'rig' or 'object'"));
      if (scope->text == "rig" && effect.always_per_object)
        return Error(*scope,
                     absl::StrCat(effect.name, " differs from object to object; its scope cannot be 'rig'"));
      instance->per_object = scope->text == "object";
    }
    const YamlNode* objects = body.Find("objects");
    if (objects == nullptr || objects->kind == Kind::kNull) return absl::OkStatus();
    if (!instance->per_object)
      return Error(*objects, "values for single objects need 'scope: object' beside them");
    TOUCHSTONE_RETURN_IF_ERROR(Want(*objects, Kind::kMap, "objects", "{lat00: {parameter: value}, ...}"));
    for (size_t k = 0; k < objects->keys.size(); ++k) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::string name, Text(objects->keys[k], "the name of an object"));
      TOUCHSTONE_RETURN_IF_ERROR(Want(objects->items[k], Kind::kMap, name, "{parameter: value, ...}"));
      // What an object does not say it has in common with the others.
      std::vector<double> values = instance->values;
      TOUCHSTONE_RETURN_IF_ERROR(ReadValues(objects->items[k], effect, {}, &values));
      instance->object_values.emplace(name, std::move(values));
    }
    return absl::OkStatus();
  }

  absl::Status ReadFormula(const YamlNode& key, const YamlNode& body, EffectInstance* instance) const {
    TOUCHSTONE_RETURN_IF_ERROR(CheckKeys(
        body, "formula", {"name", "adds", "stage", "expression", "parameters", "scope", "objects"}));
    FormulaFields fields;
    const std::pair<const char*, std::string*> texts[] = {{"name", &fields.name},
                                                          {"adds", &fields.adds},
                                                          {"stage", &fields.stage},
                                                          {"expression", &fields.expression}};
    for (const auto& [name, text] : texts) {
      const YamlNode* node = body.Find(name);
      if (node == nullptr) continue;
      if (node->kind != Kind::kScalar)
        return Error(*node,
                     absl::StrCat("formula.", name, " is ", node->KindInWords(), "; it must be a text"));
      *text = node->text;
    }
    if (const YamlNode* parameters = body.Find("parameters");
        parameters != nullptr && parameters->kind != Kind::kNull) {
      TOUCHSTONE_RETURN_IF_ERROR(
          Want(*parameters, Kind::kMap, "formula.parameters", "{k: {value: 0, unit: mm, min: -1, max: 1}}"));
      for (size_t k = 0; k < parameters->keys.size(); ++k) {
        const YamlNode& name = parameters->keys[k];
        const YamlNode& declared = parameters->items[k];
        TOUCHSTONE_RETURN_IF_ERROR(Want(declared, Kind::kMap, absl::StrCat("parameter ", name.text),
                                        "{value: 0, unit: mm, min: -1, max: 1}"));
        TOUCHSTONE_RETURN_IF_ERROR(
            CheckKeys(declared, absl::StrCat("parameter ", name.text), {"value", "unit", "min", "max"}));
        FormulaFields::Parameter parameter;
        parameter.name = name.text;
        for (size_t j = 0; j < declared.keys.size(); ++j) {
          if (declared.items[j].kind != Kind::kScalar)
            return Error(declared.items[j],
                         absl::StrCat(name.text, ".", declared.keys[j].text, " is ",
                                      declared.items[j].KindInWords(), "; it must be a single value"));
          parameter.fields[declared.keys[j].text] = declared.items[j].text;
        }
        fields.parameters.push_back(std::move(parameter));
      }
    }
    const absl::StatusOr<FormulaSpec> spec = fields.ToSpec();
    if (!spec.ok()) return Error(key, spec.status().message());
    absl::StatusOr<std::shared_ptr<const Effect>> effect = catalogue_.MakeFormula(*spec);
    // Most errors of a formula are in its expression.
    if (!effect.ok()) return Error(*body.Find("expression"), effect.status().message());
    instance->effect = *std::move(effect);
    for (size_t p = 0; p < spec->values.size(); ++p)
      instance->values.push_back(ToSi(spec->parameters[p].unit, spec->values[p]));
    return absl::OkStatus();
  }

  absl::Status ReadLookup(const YamlNode& key, const YamlNode& body, EffectInstance* instance) const {
    TOUCHSTONE_RETURN_IF_ERROR(
        CheckKeys(body, "lookup", {"name", "adds", "stage", "covariate", "knots", "values"}));
    LookupFields fields;
    const std::pair<const char*, std::string*> texts[] = {{"name", &fields.name},
                                                          {"adds", &fields.adds},
                                                          {"stage", &fields.stage},
                                                          {"covariate", &fields.covariate}};
    for (const auto& [name, text] : texts)
      if (const YamlNode* node = body.Find(name)) {
        TOUCHSTONE_ASSIGN_OR_RETURN(*text, Text(*node, absl::StrCat("lookup.", name)));
      }
    const YamlNode *knots = body.Find("knots"), *values = body.Find("values");
    if (knots != nullptr) {
      TOUCHSTONE_ASSIGN_OR_RETURN(fields.knots, Numbers(*knots, "lookup.knots"));
    }
    if (values != nullptr && values->kind == Kind::kMap) {
      for (size_t k = 0; k < values->keys.size(); ++k) {
        const std::string& finger = values->keys[k].text;
        TOUCHSTONE_ASSIGN_OR_RETURN(fields.values[finger],
                                    Numbers(values->items[k], absl::StrCat("lookup.values.", finger)));
      }
    } else if (values != nullptr) {
      TOUCHSTONE_ASSIGN_OR_RETURN(fields.values[""], Numbers(*values, "lookup.values"));
    }
    const absl::StatusOr<LookupSpec> spec = fields.ToSpec(model_.fingers);
    if (!spec.ok()) return Error(key, spec.status().message());
    absl::StatusOr<std::shared_ptr<const Effect>> effect = catalogue_.MakeLookup(*spec);
    if (!effect.ok()) return Error(key, effect.status().message());
    instance->effect = *std::move(effect);
    return absl::OkStatus();
  }

  absl::Status ReadSurfaceMap(const YamlNode& key, const YamlNode& body, EffectInstance* instance) const {
    TOUCHSTONE_RETURN_IF_ERROR(CheckKeys(body, "surface_map", {"file", "csv"}));
    const YamlNode *file = body.Find("file"), *csv = body.Find("csv");
    if (file == nullptr)
      return Error(key, "surface_map: 'file' is missing; write for example {file: map.csv}");
    SurfaceMapSpec spec;
    TOUCHSTONE_ASSIGN_OR_RETURN(spec.file, Text(*file, "surface_map.file"));
    if (csv == nullptr && files_ == nullptr)
      return Error(*file,
                   absl::StrCat("surface_map: the content of '", spec.file,
                                "' is missing: only a model file that is read here can name files. Give "
                                "its text as 'csv', as `touchstone model show` prints it"));
    if (csv == nullptr) {
      const absl::StatusOr<std::string> text = files_(spec.file);
      if (!text.ok()) return Error(*file, absl::StrCat("surface_map: ", text.status().message()));
      TOUCHSTONE_ASSIGN_OR_RETURN(spec.objects, ParseSurfaceMap(*text, spec.file));
    } else {
      if (csv->kind != Kind::kScalar)
        return Error(*csv, absl::StrCat("surface_map.csv is ", csv->KindInWords(), "; it must be a text"));
      TOUCHSTONE_ASSIGN_OR_RETURN(
          spec.objects,
          ParseSurfaceMap(csv->text, absl::StrCat(origin_, ":", csv->line, ": surface_map.csv")));
    }
    absl::StatusOr<std::shared_ptr<const Effect>> effect = catalogue_.MakeSurfaceMap(spec);
    if (!effect.ok()) return Error(key, effect.status().message());
    instance->effect = *std::move(effect);
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<double>> Numbers(const YamlNode& node, absl::string_view what) const {
    TOUCHSTONE_RETURN_IF_ERROR(Want(node, Kind::kSequence, what, "[0, 10, 20]"));
    std::vector<double> numbers;
    for (const YamlNode& item : node.items) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const double number, Number(item, what));
      numbers.push_back(number);
    }
    return numbers;
  }

  const std::string& origin_;
  const EffectCatalogue& catalogue_;
  const ModelFileReader& files_;
  Model model_;
};

}  // namespace

absl::StatusOr<Model> ParseModel(const std::string& yaml, const std::string& origin,
                                 const EffectCatalogue& catalogue, const ModelFileReader& files) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const YamlNode root, ParseYaml(yaml, origin));
  return ModelReader(origin, catalogue, files).Read(root);
}

ModelFileReader FilesBeside(const std::string& model_path) {
  return [folder = std::filesystem::path(model_path).parent_path()](const std::string& name) {
    // An absolute name stays as it is.
    return ReadFile((folder / name).string(), kMaxYamlBytes);
  };
}

}  // namespace touchstone::model
