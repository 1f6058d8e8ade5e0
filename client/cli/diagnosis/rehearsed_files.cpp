#include "client/cli/diagnosis/rehearsed_files.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <filesystem>
#include <set>
#include <utility>

#include "client/cli/common/child_program.h"
#include "client/source/plans/session_parts.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/model/parameter_values.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

constexpr size_t kTouchesPerRequest = 1000;
constexpr size_t kShownOfLog = 2000;  // bytes, the last ones
constexpr uint64_t kMaxGeneratedBytes = 1 << 30;

class OfSimulator : public RehearsedFiles {
 public:
  explicit OfSimulator(client::Connection* connection) : connection_(connection) {}

  absl::StatusOr<std::optional<std::string>> Make(const FileToMake& file) override {
    std::vector<client::MeasuredTouch> measured = *file.plan;
    for (size_t first = 0, stop = 0; first < measured.size(); first = stop) {
      v1::TouchRequest request = client::PartOfSession(measured, first, kTouchesPerRequest);
      stop = first + static_cast<size_t>(request.touches_size());
      request.mutable_model()->set_yaml(
          model::FormatModel(file.hidden->ModelOf(file.session, file.sessions)));
      request.set_seed(file.seed);
      TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchResponse response,
                                  connection_->Call(&v1::Source::Stub::Touch, request));
      for (size_t k = first; k < stop; ++k) {
        const auto& time_s = response.results(static_cast<int>(k - first)).contact_time_s();
        measured[k].time_s.assign(time_s.begin(), time_s.end());
      }
    }
    return client::FormatMeasurements(measured);
  }

 private:
  client::Connection* connection_;
};

// A folder under TMPDIR that goes with it.
class WorkFolder {
 public:
  WorkFolder() {
    std::error_code error;
    path_ = (fs::temp_directory_path(error) / "touchstone-rehearse-XXXXXX").string();
    made_ = !error && ::mkdtemp(path_.data()) != nullptr;
  }
  ~WorkFolder() {
    std::error_code error;
    if (made_) fs::remove_all(path_, error);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  bool made() const { return made_; }
  std::string Path(const char* name) const { return (fs::path(path_) / name).string(); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  bool made_ = false;
};

std::string EndOf(const std::string& path) {
  const absl::StatusOr<std::string> text = ReadFile(path);
  if (!text.ok() || absl::StripAsciiWhitespace(*text).empty()) return "; it said nothing";
  const size_t begin = text->size() > kShownOfLog ? text->size() - kShownOfLog : 0;
  return absl::StrCat("; it said:\n", absl::StripAsciiWhitespace(absl::string_view(*text).substr(begin)));
}

class OfProgram : public RehearsedFiles {
 public:
  OfProgram(std::string path, GeneratorOptions options)
      : path_(std::move(path)), options_(std::move(options)) {}

  absl::StatusOr<std::optional<std::string>> Make(const FileToMake& file) override {
    const WorkFolder folder;
    if (!folder.made())
      return absl::FailedPreconditionError(
          absl::StrCat(folder.path(), ": a folder for --generator cannot be made there; set TMPDIR"));
    const std::string log = folder.Path("said.txt"), set = folder.Path("set.csv");
    std::vector<client::MeasuredTouch> plan = *file.plan;
    for (client::MeasuredTouch& touch : plan) touch.time_s.clear();
    TOUCHSTONE_RETURN_IF_ERROR(
        WriteFileAtomically(folder.Path("plan.csv"), client::FormatMeasurements(plan)));
    TOUCHSTONE_RETURN_IF_ERROR(
        WriteFileAtomically(folder.Path("model.yaml"), model::FormatModel(file.hidden->given)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<ChildProgram> program,
                                ChildProgram::StartAt(path_, ArgumentsFor(file, folder), log, folder.path()));
    const absl::StatusOr<int> status = program->WaitForExit(options_.limit_s);
    const std::string what =
        absl::StrCat("--generator: ", options_.program, " (", file.hidden->name, ", seed ", file.seed, "): ");
    if (absl::IsCancelled(status.status())) return status.status();
    if (!status.ok())
      return absl::Status(status.status().code(), absl::StrCat(what, status.status().message(), EndOf(log)));
    if (*status == kCannotHide) return std::nullopt;
    if (*status != 0)
      return absl::FailedPreconditionError(absl::StrCat(what, "exit status ", *status, EndOf(log)));
    if (std::error_code error; !fs::exists(set, error))
      return absl::FailedPreconditionError(
          absl::StrCat(what, "exit status 0, and no file at its --output was written", EndOf(log)));
    TOUCHSTONE_ASSIGN_OR_RETURN(std::string csv, ReadFile(set, kMaxGeneratedBytes));
    const absl::Status fits = CheckFile(csv, *file.plan);
    if (!fits.ok()) return absl::Status(fits.code(), absl::StrCat(what, fits.message()));
    return csv;
  }

 private:
  std::vector<std::string> ArgumentsFor(const FileToMake& file, const WorkFolder& folder) const {
    std::vector<std::string> arguments = {
        "--plan",    folder.Path("plan.csv"),        "--model",    folder.Path("model.yaml"),
        "--output",  folder.Path("set.csv"),         "--seed",     absl::StrCat(file.seed),
        "--session", absl::StrCat(file.session + 1), "--sessions", absl::StrCat(file.sessions)};
    for (const source::MeshSpec& mesh : options_.meshes) {
      arguments.emplace_back("--mesh");
      arguments.push_back(absl::StrCat(mesh.name, "=", fs::absolute(mesh.path).string()));
    }
    if (!file.hidden->IsHiddenIn(file.session, file.sessions)) return arguments;
    for (const std::string& words : HiddenInWords(*file.hidden)) {
      arguments.emplace_back("--hide");
      arguments.push_back(words);
    }
    return arguments;
  }

  // As many touches of the same objects as the plan has.
  static absl::Status CheckFile(const std::string& csv, const std::vector<client::MeasuredTouch>& plan) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const session::MeasurementSet set,
                                session::ParseMeasurementSet(csv, "its output"));
    if (set.fingers == 0)
      return absl::InvalidArgumentError("its output has no column t_*_us: contact times were expected");
    if (set.size() != static_cast<int>(plan.size()))
      return absl::InvalidArgumentError(absl::StrCat("its output has ", set.size(), " touches; the plan's ",
                                                     plan.size(), " were expected"));
    std::set<std::string> planned;
    for (const client::MeasuredTouch& touch : plan) planned.insert(touch.object);
    for (const std::string& object : set.objects)
      if (planned.count(object) == 0)
        return absl::InvalidArgumentError(
            absl::StrCat("its output has the object '", object, "', which the plan has not"));
    return absl::OkStatus();
  }

  std::string path_;
  GeneratorOptions options_;
};

}  // namespace

std::unique_ptr<RehearsedFiles> SimulatedFiles(client::Connection* connection) {
  return std::make_unique<OfSimulator>(connection);
}

absl::StatusOr<std::unique_ptr<RehearsedFiles>> GeneratedFiles(const GeneratorOptions& options) {
  absl::StatusOr<std::string> path = PathOfProgram(options.program);
  if (!path.ok())
    return absl::Status(path.status().code(), absl::StrCat("--generator: ", path.status().message()));
  return std::make_unique<OfProgram>(*std::move(path), options);
}

std::vector<std::string> HiddenInWords(const RehearsedCase& hidden) {
  if (hidden.is_outside) return {"outside"};
  std::vector<std::string> all;
  for (const std::string& name : hidden.effects)
    for (const model::EffectInstance& instance : hidden.model.effects) {
      if (instance.effect->name != name) continue;
      std::string words = name;
      const model::Effect& effect = *instance.effect;
      for (size_t i = 0; i < effect.parameters.size(); ++i) {
        const int offset = model::ValueOffset(effect, static_cast<int>(i), hidden.model.fingers);
        std::string values = model::FileNumbers(
            effect.parameters[i],
            absl::MakeSpan(instance.values)
                .subspan(static_cast<size_t>(offset), effect.parameters[i].Count(hidden.model.fingers)));
        absl::StrAppend(&words, " ", effect.parameters[i].name, "=",
                        absl::StrReplaceAll(values, {{"[", ""}, {"]", ""}, {" ", ""}}));
      }
      all.push_back(std::move(words));
    }
  return all;
}

std::string WithFingersExchanged(const std::string& csv) {
  const size_t end = csv.find('\n');
  std::vector<std::string> names = absl::StrSplit(csv.substr(0, end), ',');
  std::vector<std::string*> times;
  for (std::string& name : names) {
    const absl::string_view plain = absl::StripAsciiWhitespace(name);
    if (absl::StartsWith(plain, "t_") && absl::EndsWith(plain, "_us")) times.push_back(&name);
  }
  if (times.size() < 2) return csv;
  std::swap(*times[0], *times[1]);
  return absl::StrJoin(names, ",") + (end == std::string::npos ? "" : csv.substr(end));
}

}  // namespace touchstone::cli
