// touchstone model new|show|add|remove|diff: model files. A file is never changed; every change is a new one.
#include <absl/strings/str_join.h>

#include <filesystem>

#include "client/cli/common/common.h"
#include "client/cli/options/model_output.h"
#include "client/source/dataset/lab_units.h"
#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::cli {
namespace {

struct ModelOptions {
  std::string name = "nominal";
  int fingers = 3;
  double spacing_mm = 30;
  std::string model, other, effect, output;
  std::vector<std::string> assignments;
};

// A model named by file, hash or name. Files are read here, the rest is asked of the source.
absl::StatusOr<model::Model> LoadModel(const Cli& cli, const std::string& text) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ModelRef ref, ParseModelRef(text));
  if (ref.has_yaml()) return model::ParseModel(ref.yaml(), text, effects::Catalogue());
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  v1::GetModelRequest request;
  *request.mutable_model() = ref;
  absl::StatusOr<v1::Model> model = connection->Call(&v1::Models::Stub::GetModel, request);
  if (absl::IsNotFound(model.status()))
    return absl::NotFoundError(absl::StrCat(model.status().message(),
                                            "; a model file is given with its folder or extension: ./", text,
                                            " or ", text, ".yaml"));
  TOUCHSTONE_RETURN_IF_ERROR(model.status());
  return model::ParseModel(model->yaml(), text, effects::Catalogue());
}

Json ModelJson(const model::Model& model) {
  return {{"name", model.name},
          {"hash", model.Hash()},
          {"fingers", model.fingers},
          {"spacing_mm", client::LabNumber(Unit::kMillimetre, model.spacing_m)},
          {"yaml", model::FormatModel(model)}};
}

absl::Status Save(const Cli& cli, const model::Model& model, const ModelOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(WriteModel(cli, "-o", options.output, model));
  if (options.output.empty()) return absl::OkStatus();
  if (cli.output().json)
    PrintJson(ModelJson(model));
  else
    cli.LogWritten(options.output,
                   absl::StrCat(" (", model.name, ", hash ", model.Hash().substr(0, 12), ")"));
  return absl::OkStatus();
}

absl::Status RunNew(const Cli& cli, const ModelOptions& options) {
  if (options.fingers < 1 || options.fingers > model::kMaxFingers)
    return absl::InvalidArgumentError(
        absl::StrCat("--fingers: ", options.fingers, " is out of range; 1 to ", model::kMaxFingers));
  if (!(options.spacing_mm > 0))
    return absl::InvalidArgumentError(
        absl::StrCat("--spacing-mm: ", ShortestNumber(options.spacing_mm), " is out of range; above 0"));
  model::Model model = model::NominalModel(options.fingers, ToSi(Unit::kMillimetre, options.spacing_mm));
  model.name = options.name;
  // What is written is what would be read: the file's own checks apply (to the name, for instance).
  TOUCHSTONE_RETURN_IF_ERROR(
      model::ParseModel(model::FormatModel(model), "the new model", effects::Catalogue()).status());
  return Save(cli, model, options);
}

absl::Status RunShow(const Cli& cli, const ModelOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model, LoadModel(cli, options.model));
  if (cli.output().json) {
    PrintJson(ModelJson(model));
    return absl::OkStatus();
  }
  return cli.Print(absl::StrCat("# hash ", model.Hash(), "\n", model::FormatModel(model)));
}

absl::Status SaveChanged(const Cli& cli, const model::Model& before, model::Model after,
                         const ModelOptions& options) {
  // A new model under the old one's name would be refused by a server that knows the old one.
  const std::string stem = std::filesystem::path(options.output).stem().string();
  if (!stem.empty() && !IsStandardOutput(options.output)) after.name = stem;
  TOUCHSTONE_RETURN_IF_ERROR(
      model::ParseModel(model::FormatModel(after), options.output, effects::Catalogue()).status());
  TOUCHSTONE_RETURN_IF_ERROR(Save(cli, after, options));
  if (!cli.output().json)
    for (const std::string& line : model::DiffModels(before, after)) cli.Log("  " + line);
  return absl::OkStatus();
}

// An effect whose parameters are all left out acts on nothing.
absl::Status CheckAnyValue(const ModelOptions& options) {
  if (!options.assignments.empty()) return absl::OkStatus();
  const std::shared_ptr<const model::Effect> effect = effects::Catalogue().Find(options.effect);
  if (effect == nullptr || effect->parameters.empty()) return absl::OkStatus();
  // Typical sizes are in the unit of files; those of several numbers are shown by `touchstone effects`.
  std::vector<std::string> examples;
  for (const model::ParameterInfo& parameter : effect->parameters)
    if (parameter.arity == model::Arity::kScalar)
      examples.push_back(absl::StrCat(parameter.name, "=", ShortestNumber(parameter.typical)));
  return absl::InvalidArgumentError(
      absl::StrCat("'", options.effect, "' without a value changes nothing; its size was expected",
                   examples.empty() ? "" : ", for instance ", absl::StrJoin(examples, " "),
                   " (touchstone effects ", options.effect, " tells more)"));
}

absl::Status RunAdd(const Cli& cli, const ModelOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckAnyValue(options));
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model before, LoadModel(cli, options.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      model::Model after, model::AddEffect(before, options.effect, options.assignments, effects::Catalogue(),
                                           model::FilesBeside("")));
  return SaveChanged(cli, before, std::move(after), options);
}

absl::Status RunRemove(const Cli& cli, const ModelOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model before, LoadModel(cli, options.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model after, model::RemoveEffect(before, options.effect));
  return SaveChanged(cli, before, std::move(after), options);
}

absl::Status RunDiff(const Cli& cli, const ModelOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model before, LoadModel(cli, options.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model after, LoadModel(cli, options.other));
  const std::vector<std::string> lines = model::DiffModels(before, after);
  if (cli.output().json) {
    PrintJson({{"before_hash", before.Hash()}, {"after_hash", after.Hash()}, {"differences", lines}});
    return absl::OkStatus();
  }
  if (lines.empty())
    return cli.Print("The physics is the same (hash " + before.Hash().substr(0, 12) + ").\n");
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return cli.Print(text);
}

}  // namespace

void AddModel(Cli* cli) {
  auto options = std::make_shared<ModelOptions>();
  CLI::App* group = cli->AddGroup(
      "model", "Makes, shows, extends and compares models: a rig and the physical effects that act on it.",
      "touchstone model new --spacing-mm 30 -o nominal.yaml\n"
      "touchstone model add nominal.yaml tip_radius radius_mm=3 -o tips.yaml\n"
      "touchstone model show tips.yaml\n"
      "touchstone model diff nominal.yaml tips.yaml");
  const auto add_output = [&](CLI::App* command) {
    cli->AddOutput(command, "-o,--output", &options->output, "The file to write. Default: stdout");
  };

  CLI::App* make =
      cli->AddCommand(group, "new", "Writes a model without any effect: the nominal rig.",
                      "touchstone model new -o nominal.yaml\n"
                      "touchstone model new --fingers 5 --spacing-mm 12 --name five -o five.yaml",
                      [cli, options] { return RunNew(*cli, *options); });
  make->add_option("--name", options->name, "The model's name. Default: nominal")->type_name("NAME");
  make->add_option("--fingers", options->fingers, "Number of fingers, 1 to 16. Default: 3")->type_name("N");
  make->add_option("--spacing-mm", options->spacing_mm, "Distance between neighbouring fingers. Default: 30")
      ->type_name("MM");
  add_output(make);

  CLI::App* show = cli->AddCommand(group, "show", "Prints a model and its content hash.",
                                   "touchstone model show nominal\n"
                                   "touchstone model show tips.yaml --json",
                                   [cli, options] { return RunShow(*cli, *options); });
  show->add_option("MODEL", options->model, "A model file, a name or a hash")->type_name("")->required();
  cli->AddSourceOptions(show);

  CLI::App* add = cli->AddCommand(
      group, "add", "Writes a new model with one more effect; the old one stays as it is.",
      "touchstone model add nominal.yaml tip_radius radius_mm=3 -o tips.yaml\n"
      "touchstone model add tips.yaml channel_latency latency_us=200,0,-200 -o late.yaml\n"
      "touchstone model add nominal.yaml object_pose translation_mm=0.2,0,0 scope=object -o pose.yaml\n"
      "touchstone model add nominal.yaml formula name=screw adds=travel_mm \\\n"
      "    'expression=k * sin(2*pi*travel_mm/lead)' k=0.1 k_unit=mm lead=4 lead_unit=mm -o screw.yaml",
      [cli, options] { return RunAdd(*cli, *options); });
  cli->AddInput(
      add,
      add->add_option("MODEL", options->model, "A model file, a name or a hash")->type_name("")->required());
  add->add_option("EFFECT", options->effect, "An effect of touchstone effects")->type_name("")->required();
  add->add_option(
         "PARAMETER=VALUE", options->assignments,
         "Its parameters, in the units of their names; one value per finger or a vector, with commas")
      ->type_name("");
  add_output(add);
  cli->AddSourceOptions(add);

  CLI::App* remove =
      cli->AddCommand(group, "remove", "Writes a new model without one effect; the old one stays as it is.",
                      "touchstone model remove tips.yaml tip_radius -o points.yaml",
                      [cli, options] { return RunRemove(*cli, *options); });
  cli->AddInput(remove, remove->add_option("MODEL", options->model, "A model file, a name or a hash")
                            ->type_name("")
                            ->required());
  remove->add_option("EFFECT", options->effect, "An effect of the model; a formula or lookup by its own name")
      ->type_name("")
      ->required();
  add_output(remove);
  cli->AddSourceOptions(remove);

  CLI::App* diff = cli->AddCommand(group, "diff", "Says in words what differs between two models.",
                                   "touchstone model diff nominal.yaml tips.yaml\n"
                                   "touchstone model diff nominal tips.yaml --json",
                                   [cli, options] { return RunDiff(*cli, *options); });
  diff->add_option("BEFORE", options->model, "A model file, a name or a hash")->type_name("")->required();
  diff->add_option("AFTER", options->other, "Another")->type_name("")->required();
  cli->AddSourceOptions(diff);
  AddModelPromote(cli, group);
}

}  // namespace touchstone::cli
