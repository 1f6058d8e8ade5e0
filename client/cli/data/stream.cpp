// touchstone stream: a dataset as files.
#include <absl/strings/numbers.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>

#include "client/cli/common/interrupt.h"
#include "client/cli/common/progress_bar.h"
#include "client/cli/options/motion_options.h"
#include "client/cli/options/plan_options.h"
#include "client/cli/options/report_posterior.h"
#include "client/cli/options/slurm.h"
#include "client/source/dataset/dataset_folder.h"
#include "client/source/dataset_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

struct StreamOptions {
  PlanOptions plan;
  ImageFlags image;
  MotionFlags motion;
  SlurmFlags slurm;
  std::vector<std::string> objects;
  std::vector<std::string> columns;
  std::string model;
  std::string uncertainty, models_from;  // reports
  std::optional<uint64_t> samples;
  uint64_t seed = 0;
  uint32_t max_draws = 1000;
  std::string encoding;
  std::string output;
  std::string format = "webdataset";
  std::string shards = "0/1";
  std::string like;
  uint64_t shard_size = 10000;
  uint32_t batch_size = 0;
  bool restart = false;
};

constexpr uint64_t kDefaultSamples = 1000;
constexpr char kUncertaintyColumn[] = "std_uncertainty";

// The objects of the source, for "all".
absl::StatusOr<std::vector<std::string>> AllObjects(client::Connection* connection) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse response,
                              connection->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  std::vector<std::string> names;
  for (const v1::Object& object : response.objects()) names.push_back(object.name());
  return names;
}

bool Contains(const google::protobuf::RepeatedPtrField<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// What the report of a diagnosis adds: uncertainties, or models that are drawn.
absl::Status AddPosterior(const Cli& cli, const StreamOptions& o, v1::DatasetSpec* spec) {
  if (o.uncertainty.empty() && o.models_from.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const ReportedPosterior reported,
                              PosteriorOfReport(o.models_from.empty() ? o.uncertainty : o.models_from));
  if (!reported.note.empty()) cli.Log(reported.note);
  *spec->mutable_posterior() = reported.posterior;
  spec->set_draw_models(!o.models_from.empty());
  if (o.uncertainty.empty()) return absl::OkStatus();
  if (!Contains(spec->columns(), kUncertaintyColumn)) spec->add_columns(kUncertaintyColumn);
  if (o.models_from.empty() || o.models_from == o.uncertainty) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const ReportedPosterior other, PosteriorOfReport(o.uncertainty));
  if (other.posterior.SerializeAsString() == spec->posterior().SerializeAsString()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("--uncertainty: ", o.uncertainty,
                                                 " is another report than that of --models-from, ",
                                                 o.models_from, "; a dataset has one"));
}

absl::StatusOr<v1::DatasetSpec> MakeSpec(const Cli& cli, const StreamOptions& o, client::ShardFormat format,
                                         client::Connection* connection) {
  v1::DatasetSpec spec;
  if (o.samples == uint64_t{0})
    return absl::InvalidArgumentError("--samples: 0 is out of range; 1 or more was expected");
  std::vector<std::string> columns = SplitCommas(o.columns);
  const bool any_image_option = !o.image.size.empty() || !o.encoding.empty() || o.image.depth || o.image.mask;
  PlanOptions plan = o.plan;
  plan.pictures = any_image_option || std::find(columns.begin(), columns.end(), "image") != columns.end();
  std::vector<std::string> objects_of_file;
  TOUCHSTONE_ASSIGN_OR_RETURN(*spec.mutable_plan(), MakePlan(plan, &objects_of_file));
  std::vector<std::string> objects = SplitCommas(o.objects);
  if (objects.empty() && objects_of_file.size() > 1)
    return absl::InvalidArgumentError(absl::StrCat("--plan: ", o.plan.plan, " names ", objects_of_file.size(),
                                                   " objects (", absl::StrJoin(objects_of_file, ", "),
                                                   "), but a dataset makes every touch on every object: say "
                                                   "which with --objects, or use touchstone touch --plan"));
  if (objects.empty()) objects = objects_of_file;
  if (objects.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(objects, AllObjects(connection));
  }
  for (const std::string& object : objects) spec.add_objects(object);
  TOUCHSTONE_ASSIGN_OR_RETURN(*spec.mutable_model(), ParseModelRef(o.model));
  spec.set_seed(o.seed);
  // A plan that ends gives the number itself.
  spec.set_samples(o.samples.value_or(spec.plan().has_sphere() ? kDefaultSamples : 0));
  spec.set_max_draws(o.max_draws);

  if (columns.empty()) columns = {"index", "object", "pose", "descriptor"};
  for (const std::string& column : columns) {
    TOUCHSTONE_RETURN_IF_ERROR(OneOf("--columns", column,
                                     {"index", "object", "descriptor", "contact_time", "pose", "contact",
                                      "image", kUncertaintyColumn, "model_values"})
                                   .status());
    if (!Contains(spec.columns(), column)) spec.add_columns(column);
  }
  TOUCHSTONE_RETURN_IF_ERROR(AddPosterior(cli, o, &spec));
  if (any_image_option && !Contains(spec.columns(), "image")) spec.add_columns("image");
  // A folder's table is a measurement file, which has these.
  if (format == client::ShardFormat::kFolder) {
    for (const char* needed : {"object", "pose"})
      if (!Contains(spec.columns(), needed)) spec.add_columns(needed);
    if (!Contains(spec.columns(), "contact_time") && !Contains(spec.columns(), "descriptor"))
      spec.add_columns("descriptor");
  }
  if (Contains(spec.columns(), "image")) {
    const bool hdf5 = format == client::ShardFormat::kHdf5;
    const std::string encoding = !o.encoding.empty() ? o.encoding : hdf5 ? "raw" : "png";
    if (hdf5 && encoding != "raw")
      return absl::InvalidArgumentError(absl::StrCat(
          "--encoding: ", encoding, " does not go into HDF5, which holds pixels; raw is right there"));
    TOUCHSTONE_ASSIGN_OR_RETURN(*spec.mutable_image(), MakeImageSpec(cli, o.image, encoding));
  }
  return spec;
}

// Says which objects fill the frame. A source that does not list its objects is asked again when samples are made.
absl::Status NoteCloseCameras(const Cli& cli, const v1::DatasetSpec& spec, client::Connection* connection) {
  if (!Contains(spec.columns(), "image")) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse response,
                              connection->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  for (const v1::Object& object : response.objects()) {
    if (!Contains(spec.objects(), object.name())) continue;
    const std::string note = CloseCameraNote(spec.plan(), object, spec.image().vertical_fov_rad());
    if (!note.empty()) cli.Log("note: " + note);
  }
  return absl::OkStatus();
}

// "3/8": the fourth of eight jobs.
absl::Status ParseShards(const std::string& text, client::DatasetJob* job) {
  const size_t slash = text.find('/');
  if (slash == std::string::npos || !absl::SimpleAtoi(text.substr(0, slash), &job->job_index) ||
      !absl::SimpleAtoi(text.substr(slash + 1), &job->job_count) || job->job_index >= job->job_count)
    return absl::InvalidArgumentError(absl::StrCat(
        "--shards: '", text, "' is not K/N with K from 0 to N - 1, for instance 0/4, 1/4, 2/4 and 3/4"));
  return absl::OkStatus();
}

// What another dataset was made of, so that it is made again.
absl::Status RepeatManifest(const StreamOptions& o, client::DatasetJob* job, bool shard_size_given) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const client::DatasetManifest manifest, client::ReadManifest(o.like));
  TOUCHSTONE_ASSIGN_OR_RETURN(job->spec, client::SpecOfManifest(manifest.identity, o.like));
  TOUCHSTONE_ASSIGN_OR_RETURN(job->format, client::ParseShardFormat(manifest.identity.value("format", "")));
  if (!shard_size_given) job->shard_size = manifest.identity.value("shard_size", job->shard_size);
  return absl::OkStatus();
}

Json ResultJson(const client::DatasetJob& job, const client::DatasetResult& result, double elapsed_s) {
  return {{"folder", job.folder},
          {"complete", result.dataset_complete},
          {"samples", result.samples_in_dataset},
          {"samples_written", result.samples_written},
          {"draws", result.draws},
          {"shards_written", result.shards_written},
          {"shards_found", result.shards_found},
          {"elapsed_s", elapsed_s},
          {"samples_per_s", elapsed_s > 0 ? result.samples_written / elapsed_s : 0}};
}

void Summarise(const Cli& cli, const client::DatasetJob& job, const client::DatasetResult& result,
               double elapsed_s) {
  const std::string place = absl::StrCat(job.folder, "/", client::kManifestName);
  const std::string found = Counted(result.shards_found, "shard", "shards");
  if (result.shards_written + result.shards_found == 0)
    cli.Log(absl::StrCat(
        "nothing for job ", job.job_index, " of ", job.job_count, ": ", result.samples_in_dataset,
        " samples make ",
        Counted((result.samples_in_dataset + job.shard_size - 1) / job.shard_size, "shard", "shards"), " of ",
        job.shard_size, ", which go to the jobs from 0 on. A --shard-size of ",
        std::max<uint64_t>(1, result.samples_in_dataset / job.job_count),
        ", the same in all jobs, gives each one something"));
  else if (result.shards_written == 0)
    cli.Log(absl::StrCat("nothing to do: ", found, " of ", job.folder, " stood already"));
  else
    cli.Log(absl::StrCat("wrote ", Counted(result.samples_written, "sample", "samples"), " in ",
                         Counted(result.shards_written, "shard", "shards"),
                         result.shards_found > 0 ? " (" + found + " stood already)" : "",
                         result.draws > 0 ? " by " + Counted(result.draws, "draw", "draws") : "", " in ",
                         Rounded(elapsed_s), " s, ", Rounded(result.samples_written / elapsed_s),
                         " samples/s"));
  cli.Log(result.dataset_complete ? absl::StrCat(place, ": ", result.samples_in_dataset, " samples, complete")
                                  : absl::StrCat("this job's part is done; ", place,
                                                 " comes with the last of the ", job.job_count, " jobs"));
}

absl::Status RunStream(const Cli& cli, const StreamOptions& o, bool shard_size_given) {
  client::DatasetJob job;
  job.folder = o.output;
  job.shard_size = o.shard_size;
  job.batch_size = o.batch_size;
  job.restart = o.restart;
  TOUCHSTONE_RETURN_IF_ERROR(ParseShards(o.shards, &job));
  std::error_code error;
  if (o.restart && std::filesystem::equivalent(std::filesystem::path(o.like).parent_path(), o.output, error))
    return absl::InvalidArgumentError(
        "--restart would delete the dataset that --like names; choose another folder for --out");
  TOUCHSTONE_ASSIGN_OR_RETURN(job.format, client::ParseShardFormat(o.format));
  if (!o.like.empty()) TOUCHSTONE_RETURN_IF_ERROR(RepeatManifest(o, &job, shard_size_given));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  if (o.like.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(job.spec, MakeSpec(cli, o, job.format, connection.get()));
    TOUCHSTONE_RETURN_IF_ERROR(NoteCloseCameras(cli, job.spec, connection.get()));
  }
  if (o.slurm.submit) return SubmitToSlurm(cli, o.slurm, connection.get(), std::move(job));

  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, connection.get(), o.motion));
  job.lease = source->lease();
  job.session = o.motion.session;
  // Where a touch takes seconds, each is reported when it is done.
  if (source->physical() && job.batch_size == 0) job.batch_size = 1;
  client::DatasetWriter writer(connection.get(), job);
  writer.on_log = [&](const std::string& line) {
    bar.Clear();
    cli.Log(line);
  };
  writer.on_progress = [&](const client::DatasetProgress& progress) {
    bar.Show(progress.samples_done, progress.samples_in_job, progress.samples_this_run);
  };
  const auto start = std::chrono::steady_clock::now();
  absl::Status status;
  {
    const Interrupt::Handler on_interrupt([&writer, &source] {
      source->Interrupt("interrupted at the command line");
      writer.Cancel();
    });
    bar.ShowStage("reading what is there");
    status = writer.Run();
  }
  bar.Clear();
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const client::DatasetResult& result = writer.result();
  if (Interrupt::Raised() && absl::IsCancelled(status)) {
    const uint64_t whole = result.shards_found + result.shards_written;
    cli.Log(absl::StrCat("interrupted: ", Counted(whole, "whole shard stands", "whole shards stand"), " in ",
                         job.folder, ". Run the same command again to resume"));
    return status;
  }
  TOUCHSTONE_RETURN_IF_ERROR(status);
  if (cli.output().json) PrintJson(ResultJson(job, result, elapsed_s));
  Summarise(cli, job, result, elapsed_s);
  return absl::OkStatus();
}

}  // namespace

void AddStream(Cli* cli) {
  auto options = std::make_shared<StreamOptions>();
  auto shard_size = std::make_shared<CLI::Option*>(nullptr);
  CLI::App* command = cli->AddCommand(
      nullptr, "stream",
      "Writes a dataset of touches and images as files. Interrupted in whatever way, the same command "
      "resumes where it stopped, and the result is the same, byte for byte.",
      "touchstone stream --samples 100000 --out data\n"
      "touchstone stream --objects lat00,lat20 --samples 10000 --image 224x224 --out data\n"
      "touchstone stream --plan faces --model noisy.yaml --to folder --out faces\n"
      "touchstone stream --samples 1000000 --shards 0/4 --server a:50051,b:50051 --out data    "
      "one of four jobs\n"
      "touchstone stream --samples 1000000 --out data --slurm --slurm-option=--time=60          "
      "by a Slurm cluster\n"
      "touchstone stream --models-from report.json --samples 100000 --out data                 "
      "each by a model of its own\n"
      "touchstone stream --like data/dataset.json --out again                                  "
      "the same once more",
      [cli, options, shard_size] { return RunStream(*cli, *options, (*shard_size)->count() > 0); });
  const auto add = [&](const std::string& name, auto& value, const std::string& type, const std::string& text,
                       const std::string& group) {
    return command->add_option(name, value, text)->type_name(type)->group(group);
  };
  std::vector<CLI::Option*> specification;
  const char* what = "What to make";
  specification.push_back(
      add("--objects", options->objects, "A,B,...",
          "Objects; sample i shows object i mod their number. Default: all that the source has", what));
  specification.back()->take_all()->expected(1);
  specification.push_back(add("-n,--samples", options->samples, "N",
                              "Samples in all. Default: 1000, or the whole of a plan that ends", what));
  specification.push_back(add("--seed", options->seed, "N", "Seed of poses and noise. Default: 0", what));
  specification.push_back(
      add("--model", options->model, "MODEL", "Model file, name or hash. Default: the source's own", what));
  cli->AddInput(command, specification.back());
  specification.push_back(add("--columns", options->columns, "A,B,...",
                              "Of index, object, descriptor, contact_time, pose, contact, image; with "
                              "--models-from also model_values, each sample's own. "
                              "Default: index,object,pose,descriptor, and image with any image option",
                              what));
  specification.back()->take_all()->expected(1);
  const auto add_report = [&](const std::string& name, std::string& path, const std::string& text) {
    specification.push_back(add(name, path, "REPORT", text, what));
    cli->AddInput(command, specification.back());
  };
  add_report("--uncertainty", options->uncertainty,
             "Report of the diagnosis that found the model (diagnose --json): adds the columns "
             "std_uncertainty_us of every contact "
             "time, less the mean over its touch, and beyond_measured");
  add_report("--models-from", options->models_from,
             "The same report: every sample has a model of its own, drawn from what the report leaves open");
  specification.push_back(
      add("--max-draws", options->max_draws, "N",
          "A touch that misses is drawn again this often before the stream fails. Default: 1000", what));
  const char* files = "Files";
  cli->AddOutput(
         command, "--out", &options->output,
         "Where the shards and dataset.json go. What is there of the same dataset is resumed; another "
         "dataset is refused",
         OutputKind::kFolder)
      ->group(files)
      ->required();
  const auto* to =
      add("--to", options->format, "FORMAT",
          "webdataset: tar files; folder: touches.csv and images; hdf5. Default: webdataset", files);
  *shard_size = add("--shard-size", options->shard_size, "N",
                    "Samples per shard: what an interruption loses at most. Default: 10000", files);
  CLI::Option* shards =
      add("--shards", options->shards, "K/N",
          "Write only shards K, K + N, ...: the part of job K of N that share the folder. Default: 0/1, all",
          files);
  AddSlurmOptions(command, &options->slurm, shards);
  add("--batch-size", options->batch_size, "N",
      "Samples per message; changes no byte. Default: the source's own", files);
  CLI::Option* like =
      add("--like", options->like, "DATASET.JSON",
          "Make the dataset of that file again: everything about what to make is read there", files);
  command->add_flag("--restart", options->restart, "Delete what the folder holds of a dataset first")
      ->group(files);
  AddPlanOptions(cli, command, &options->plan);
  AddImageOptions(command, &options->image);
  specification.push_back(add("--encoding", options->encoding, "FORMAT",
                              "png, jpeg or raw (.npy). Default: png; raw in HDF5", "Image"));
  for (CLI::Option* option : command->get_options())
    if (option->get_group() == "Plan" || option->get_group() == "Image") like->excludes(option);
  for (CLI::Option* option : specification)
    if (option->get_group() == what) like->excludes(option);
  like->excludes(const_cast<CLI::Option*>(to));
  AddMotionOptions(command, &options->motion, true);
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
