// touchstone normalize: a folder of photographs as dark objects on white, with their masks.
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "client/cli/common/common.h"
#include "client/cli/common/interrupt.h"
#include "client/cli/common/progress_bar.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/image/encoding/encode.h"
#include "server/image/normalize/normalize.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kMaskSuffix[] = "_mask.png";

struct NormalizeOptions {
  std::string folder, output, background;
  bool masks = false;
};

// A picture as it is named in the folder, and the file (PNG) that it becomes.
struct NormalizeJob {
  std::string file, result;
};

absl::StatusOr<image::Image> ReadPicture(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, session::kMaxPictureBytes));
  absl::StatusOr<image::Image> picture = image::DecodePicture(bytes);
  if (picture.ok()) return picture;
  return absl::Status(picture.status().code(), absl::StrCat(path, ": ", picture.status().message()));
}

// Every PNG and JPEG file of a folder that is no image set, by name.
absl::StatusOr<std::vector<NormalizeJob>> PicturesOf(const std::string& folder) {
  std::vector<NormalizeJob> jobs;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error)
    return absl::NotFoundError(
        absl::StrCat(folder, ": ", error.message(), "; a folder with pictures or an image set was expected"));
  for (const auto& entry : entries) {
    const std::string extension = absl::AsciiStrToLower(entry.path().extension().string());
    if (extension == ".png" || extension == ".jpg" || extension == ".jpeg")
      jobs.push_back({entry.path().filename().string(), entry.path().stem().string() + ".png"});
  }
  if (jobs.empty())
    return absl::NotFoundError(absl::StrCat(
        folder, ": has no image set (images.csv) and no .png or .jpg file; one of them was expected"));
  std::sort(jobs.begin(), jobs.end(), [](const auto& a, const auto& b) { return a.file < b.file; });
  return jobs;
}

class NormalizeRun {
 public:
  NormalizeRun(const Cli& cli, const NormalizeOptions& options) : cli_(cli), options_(options) {}

  absl::Status Run() {
    TOUCHSTONE_RETURN_IF_ERROR(MakeUnfinished());
    const bool is_set = session::IsImageSetFolder(options_.folder);
    absl::Status status = RunInto(is_set);
    if (status.ok()) status = Finish();
    if (!status.ok()) {
      std::error_code stays;  // a hidden folder, if the disk fails at that too
      fs::remove_all(unfinished_, stays);
      return absl::Status(status.code(),
                          absl::StrReplaceAll(status.message(), {{unfinished_.string(), options_.output}}));
    }
    if (cli_.output().json)
      PrintJson({{"folder", options_.output},
                 {"pictures", done_},
                 {"image_set", is_set},
                 {"without_object", without_object_}});
    for (const std::string& file : without_object_)
      cli_.Log(absl::StrCat(file, ": no object parts from a plain ground; the picture is white"));
    cli_.Log(absl::StrCat(
        options_.output, ": ", Counted(done_, "picture", "pictures"),
        is_set ? ", an image set as before" : "",
        without_object_.empty() ? "" : absl::StrCat("; ", without_object_.size(), " without an object")));
    return absl::OkStatus();
  }

 private:
  // The results stand in a hidden folder until they are whole.
  absl::Status MakeUnfinished() {
    std::error_code error;
    if (fs::exists(options_.output, error) && !fs::is_empty(options_.output, error))
      return absl::AlreadyExistsError(
          absl::StrCat("-o: ", options_.output,
                       " is there and not empty; a new folder was expected, so that nothing is replaced"));
    finished_ = fs::absolute(fs::weakly_canonical(options_.output, error));  // a link stays one
    if (!finished_.has_filename()) finished_ = finished_.parent_path();
    unfinished_ = UnfinishedPathOf(finished_.string());
    if (!error) fs::create_directories(finished_.parent_path(), error);
    if (!error) fs::create_directory(unfinished_, error);
    if (error)
      return absl::InvalidArgumentError(
          absl::StrCat("-o: ", options_.output, " cannot be made: ", error.message()));
    return absl::OkStatus();
  }

  // Takes the place of an empty folder.
  absl::Status Finish() const {
    TOUCHSTONE_RETURN_IF_ERROR(SyncPath(unfinished_.string()));
    return RenameSynced(unfinished_.string(), finished_.string());
  }

  absl::Status RunInto(bool is_set) {
    if (!options_.background.empty()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(background_, ReadPicture(options_.background));
    }
    return is_set ? RunSet() : RunFolder();
  }

  absl::StatusOr<image::Image> NormalizeOne(const image::Image& picture, const std::string& name) {
    absl::StatusOr<image::Image> normalized =
        image::Normalize(picture, background_ ? &*background_ : nullptr);
    if (!normalized.ok())
      return absl::Status(normalized.status().code(),
                          absl::StrCat(name, ": ", normalized.status().message()));
    if (!image::FoundObject(*normalized)) without_object_.push_back(name);
    ++done_;
    return normalized;
  }

  static absl::StatusOr<std::string> EncodeMask(const image::Image& normalized) {
    return image::EncodePng(normalized.mask.data(), normalized.width, normalized.height, 1);
  }
  // Its name beside the picture's.
  static std::string MaskOf(const std::string& picture) {
    const fs::path path(picture);
    return (path.parent_path() / (path.stem().string() + kMaskSuffix)).string();
  }

  absl::Status WriteMask(const image::Image& normalized, const std::string& result) const {
    if (!options_.masks) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string mask, EncodeMask(normalized));
    return WriteFileAtomically((unfinished_ / MaskOf(result)).string(), mask);
  }

  absl::Status RunFolder() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<NormalizeJob> jobs, PicturesOf(options_.folder));
    std::map<std::string, std::string> results;
    for (const NormalizeJob& job : jobs)
      if (const auto [other, is_new] = results.emplace(job.result, job.file); !is_new)
        return absl::InvalidArgumentError(absl::StrCat(options_.folder, ": ", other->second, " and ",
                                                       job.file, " would both become ", job.result,
                                                       "; rename one"));
    ProgressBar bar(!cli_.output().quiet);
    for (const NormalizeJob& job : jobs) {
      if (Interrupt::Raised()) return absl::CancelledError("interrupted");
      bar.Show(done_, jobs.size(), done_, "photographs");
      const std::string path = (fs::path(options_.folder) / job.file).string();
      TOUCHSTONE_ASSIGN_OR_RETURN(const image::Image picture, ReadPicture(path));
      TOUCHSTONE_ASSIGN_OR_RETURN(const image::Image normalized, NormalizeOne(picture, path));
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const std::string png,
          image::EncodePng(normalized.pixels.data(), normalized.width, normalized.height, 1));
      TOUCHSTONE_RETURN_IF_ERROR(WriteFileAtomically((unfinished_ / job.result).string(), png));
      TOUCHSTONE_RETURN_IF_ERROR(WriteMask(normalized, job.result));
    }
    bar.Clear();
    return absl::OkStatus();
  }

  // Poses, times and lens stay; the pictures become grey.
  absl::Status RunSet() {
    TOUCHSTONE_ASSIGN_OR_RETURN(v1::ImageSetFiles files, session::ReadImageSetFiles(options_.folder));
    TOUCHSTONE_ASSIGN_OR_RETURN(const session::ImageSet set, session::ParseImageSet(files));
    ProgressBar bar(!cli_.output().quiet);
    std::map<std::string, std::string> masks;
    for (size_t k = 0; k < set.size(); ++k) {
      if (Interrupt::Raised()) return absl::CancelledError("interrupted");
      bar.Show(done_, set.size(), done_, "photographs");
      const session::PhotographRow& row = set.photographs[k];
      image::Image picture;
      picture.width = set.camera.width_px, picture.height = set.camera.height_px,
      picture.channels = row.channels;
      picture.pixels = row.pixels;
      TOUCHSTONE_ASSIGN_OR_RETURN(image::Image result, NormalizeOne(picture, row.file));
      TOUCHSTONE_ASSIGN_OR_RETURN(*files.mutable_files(static_cast<int>(k))->mutable_png(),
                                  image::EncodePng(result.pixels.data(), result.width, result.height, 1));
      if (options_.masks) {
        TOUCHSTONE_ASSIGN_OR_RETURN(masks[MaskOf(row.file)], EncodeMask(result));
      }
    }
    bar.Clear();
    return session::WriteImageSetFiles(files, unfinished_.string(), masks);
  }

  const Cli& cli_;
  const NormalizeOptions& options_;
  fs::path finished_, unfinished_;
  std::optional<image::Image> background_;
  size_t done_ = 0;
  std::vector<std::string> without_object_;
};

}  // namespace

void AddNormalize(Cli* cli) {
  auto options = std::make_shared<NormalizeOptions>();
  CLI::App* command = cli->AddCommand(
      nullptr, "normalize",
      "Makes photographs alike: a dark object on white, without the ground, its uneven light "
      "and its shadows, as "
      "recognisers that were trained on such pictures expect. An image set stays one, with "
      "its poses and its lens; of any "
      "other folder every PNG and JPEG file is taken. The object must differ from a plain "
      "ground: darker than it, "
      "brighter, or of another colour; with a picture of the empty place the ground may have a pattern. "
      "Pictures of 16 bits are read as 8 bits, transparency and colour profiles are not "
      "looked at; sides from 16 to 2048 pixels. A picture in which no object parts from the "
      "ground becomes white and is named.",
      "touchstone normalize photos -o normalized\n"
      "touchstone normalize photos -o normalized --masks\n"
      "touchstone normalize photos -o normalized --background empty.png",
      [cli, options] { return NormalizeRun(*cli, *options).Run(); });
  command->add_option("FOLDER", options->folder, "An image set, or a folder with pictures")
      ->type_name("")
      ->required();
  cli->AddOutput(command, "-o,--output", &options->output, "The folder for the results; a new one",
                 OutputKind::kFolder)
      ->required();
  cli->AddInput(command,
                command
                    ->add_option("--background", options->background,
                                 "A picture of the empty place, taken from where all others were taken")
                    ->type_name("FILE"));
  command->add_flag("--masks", options->masks,
                    "Also NAME_mask.png beside each picture: 255 on the object, 0 beside it");
}

}  // namespace touchstone::cli
