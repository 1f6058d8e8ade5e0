// touchstone capture: photographs as PNG or JPEG files.
#include <cmath>
#include <filesystem>

#include "client/cli/common/progress_bar.h"
#include "client/cli/options/motion_options.h"
#include "client/cli/options/plan_options.h"
#include "client/cli/options/touch_options.h"
#include "client/source/dataset/batch.h"
#include "client/source/dataset/lab_units.h"
#include "client/source/dataset/npy.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/base/units.h"
#include "server/image/encoding/encode.h"
#include "server/service/core/convert.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

struct CaptureOptions {
  TouchFlags touch;
  ImageFlags image;
  MotionFlags motion;
  std::string object;
  std::string plan;
  std::string eye_mm, at_mm, up = "0,0,1";
  std::string output;
  std::string model;
  uint64_t seed = 0;
};

absl::Status AddViews(const CaptureOptions& options, v1::CaptureRequest* request) {
  const int given = !options.plan.empty() + !options.eye_mm.empty() + !options.touch.approach.empty();
  if (given != 1)
    return absl::InvalidArgumentError(
        "where from? Give exactly one of --approach (the camera of that touch), --eye-mm (a camera of your "
        "own) and --plan FILE (the cameras of its touches or photographs)");
  if (!options.plan.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto pictures, ReadPictures(options.plan, options.object));
    if (pictures.has_value()) {
      for (const PlannedPicture& picture : *pictures) *request->add_views() = picture.view;
      return absl::OkStatus();
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<client::MeasuredTouch> touches, ReadTouches(options.plan));
    for (client::MeasuredTouch& touch : touches)
      *request->add_views()->mutable_touch() = std::move(touch.commanded);
    return absl::OkStatus();
  }
  if (!options.eye_mm.empty()) {
    v1::CameraPose* camera = request->add_views()->mutable_camera();
    TOUCHSTONE_ASSIGN_OR_RETURN(*camera->mutable_eye_m(), ParseMillimetres("--eye-mm", options.eye_mm));
    if (!options.at_mm.empty()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(*camera->mutable_at_m(), ParseMillimetres("--at-mm", options.at_mm));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(*camera->mutable_up(), ParseVector("--up", options.up));
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(*request->add_views()->mutable_touch(), MakeTouch(options.touch));
  return absl::OkStatus();
}

// From how far away a camera of `image` has a ball of this radius whole in view, metres.
double DistanceToSee(double radius_m, const v1::ImageSpec& image) {
  // The narrower of the two angles counts; the margin keeps the outline off the picture's edge.
  constexpr double kMargin = 1.05;
  const double vertical_tan = std::tan(image.vertical_fov_rad() / 2);
  const double half_angle_rad =
      std::atan(vertical_tan * std::min(1.0, double(image.width()) / image.height()));
  return kMargin * radius_m / std::sin(half_angle_rad);
}

// What the options left open of the view, by where the object is and how large.
absl::Status LookAtObject(const CaptureOptions& options, client::Connection* connection,
                          v1::CaptureRequest* request) {
  const bool whole_view = !options.touch.approach.empty() &&
                          (options.touch.target_mm.empty() || !options.touch.standoff_mm.has_value());
  const bool camera_without_aim = !options.eye_mm.empty() && options.at_mm.empty();
  if (!whole_view && !camera_without_aim) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::Bounds bounds, BoundsOfObject(connection, options.object));
  v1::View* view = request->mutable_views(0);
  if (camera_without_aim) {
    *view->mutable_camera()->mutable_at_m() = service::ToProto(bounds.Centre());
    return absl::OkStatus();
  }
  const auto standoff = [&](const geometry::Bounds& box, const Eigen::Vector3d& target_m,
                            const Eigen::Vector3d&) {
    return DistanceToSee((target_m - box.Centre()).norm() + 0.5 * box.DiagonalM(), request->image());
  };
  AimAtObject(options.touch, bounds, standoff, view->mutable_touch());
  const double standoff_m = view->touch().standoff_m();
  if (standoff_m <= kMaxStandoffM) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("--standoff-mm: '", options.object,
                                                 "' is whole in view only from ",
                                                 Rounded(FromSi(Unit::kMillimetre, standoff_m)),
                                                 " mm off, and ", FromSi(Unit::kMillimetre, kMaxStandoffM),
                                                 " is the limit; give --standoff-mm or --eye-mm, or check "
                                                 "the mesh's unit (touchstone objects shows sizes)"));
}

// "top.png" for the first of one; "top-0003.png" for one of several.
fs::path FileOfView(const fs::path& output, int view, int views) {
  if (views == 1) return output;
  char number[16];
  std::snprintf(number, sizeof number, "-%04d", view);
  return output.parent_path() / absl::StrCat(output.stem().string(), number, output.extension().string());
}

// "side" of "views/side.png", for what stands beside the photograph: side.mask.png, side.depth_mm.npy.
std::string StemOf(const fs::path& file) {
  return (file.parent_path() / file.stem()).string();
}

// Every file that the request will give; depth is a column of its own name.
std::vector<OutputFile> FilesOf(const fs::path& output, int views, const v1::ImageSpec& image) {
  std::vector<OutputFile> files;
  for (int view = 0; view < views; ++view) {
    const fs::path file = FileOfView(output, view, views);
    const auto add = [&](const std::string& path) {
      files.push_back({"-o", path, OutputKind::kFile, /*makes_folders=*/views > 1});
    };
    add(file.string());
    if (image.mask()) add(StemOf(file) + ".mask.png");
    if (image.depth()) add(StemOf(file) + ".depth_mm.npy");
  }
  return files;
}

// A column of one photograph as a file: its path and its bytes.
absl::StatusOr<std::pair<std::string, std::string>> FileOfColumn(const v1::Column& column,
                                                                 const fs::path& file) {
  const client::FileColumn shape = client::FileColumnOf(column);
  if (column.type() == v1::DATA_TYPE_BYTES)
    return std::make_pair(file.string(), std::string(client::FileOf(column, 0)));
  std::string bytes;
  if (column.name() == "mask" && shape.shape.size() >= 2) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        bytes, image::EncodePng(reinterpret_cast<const uint8_t*>(column.data().data()),
                                static_cast<int>(shape.shape[1]), static_cast<int>(shape.shape[0]), 1));
    return std::make_pair(StemOf(file) + ".mask.png", bytes);
  }
  client::AppendLabValues(shape, column, 0, 1, &bytes);
  return std::make_pair(absl::StrCat(StemOf(file), ".", shape.name, ".npy"),
                        client::NpyFile(shape.type, shape.shape, bytes));
}

// The format of the photograph, by the name of its file; standard output gets PNG.
absl::StatusOr<std::string> EncodingOf(const std::string& output) {
  const std::string extension = fs::path(output).extension().string();
  if (IsStandardOutput(output) || extension == ".png") return std::string("png");
  if (extension == ".jpg" || extension == ".jpeg") return std::string("jpeg");
  return absl::InvalidArgumentError(
      absl::StrCat("-o: '", output, "' does not say the format; its name ends in .png or .jpg"));
}

absl::Status RunCapture(const Cli& cli, const CaptureOptions& options) {
  const fs::path output(options.output);
  v1::CaptureRequest request;
  request.set_object(options.object);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string encoding, EncodingOf(options.output));
  TOUCHSTONE_ASSIGN_OR_RETURN(*request.mutable_image(), MakeImageSpec(cli, options.image, encoding));
  TOUCHSTONE_RETURN_IF_ERROR(AddViews(options, &request));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ModelRef model, ParseModelRef(options.model));
  if (!options.model.empty()) *request.mutable_model() = model;
  request.set_seed(options.seed);
  const int view_count = request.views_size();
  if (IsStandardOutput(options.output)) {
    if (view_count != 1 || request.image().depth() || request.image().mask())
      return absl::InvalidArgumentError(
          "-o: standard output takes one photograph; several files need a name, for instance view.png");
  } else {
    TOUCHSTONE_RETURN_IF_ERROR(cli.CheckOutputs(FilesOf(output, view_count, request.image())));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  TOUCHSTONE_RETURN_IF_ERROR(LookAtObject(options, connection.get(), &request));
  const google::protobuf::RepeatedPtrField<v1::View> views = request.views();
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, connection.get(), options.motion));
  const StopOnInterrupt stop_on_interrupt(source.get());

  if (views.size() > 1 && output.has_parent_path()) {
    std::error_code error;
    fs::create_directories(output.parent_path(), error);
    if (error)
      return absl::InvalidArgumentError(
          absl::StrCat("-o: ", output.parent_path().string(), " cannot be made: ", error.message()));
  }
  // One view per request: any number of views, and no large message.
  std::vector<std::string> written;
  ProgressBar bar(!cli.output().quiet);
  for (int i = 0; i < views.size(); ++i) {
    bar.Show(i, views.size(), i, "photographs");
    request.clear_views();
    *request.add_views() = views[i];
    request.set_first_index(i);
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::CaptureResponse response, source->Capture(request));
    for (const v1::Column& column : response.columns()) {
      TOUCHSTONE_RETURN_IF_ERROR(client::ValidateColumn(column, response.rows()));
      TOUCHSTONE_ASSIGN_OR_RETURN(const auto file, FileOfColumn(column, FileOfView(output, i, views.size())));
      TOUCHSTONE_RETURN_IF_ERROR(cli.Write(file.first, file.second));
      written.push_back(file.first);
    }
  }
  if (cli.output().json) PrintJson({{"files", written}});
  if (written.size() == 1)
    cli.LogWritten(written[0]);
  else
    cli.Log(absl::StrCat("wrote ", written.size(), " files, ", written.front(), " to ", written.back()));
  return absl::OkStatus();
}

}  // namespace

void AddCapture(Cli* cli) {
  auto options = std::make_shared<CaptureOptions>();
  CLI::App* command = cli->AddCommand(
      nullptr, "capture", "Photographs an object: PNG or JPEG, with depth and mask on request.",
      "touchstone capture lat20 --approach 0,0,-1 -o top.png\n"
      "touchstone capture lat20 --eye-mm 300,200,150 --image 640x480 --format rgb -o view.jpg\n"
      "touchstone capture lat20 --eye-mm 300,0,80 --depth --mask -o side.png    also side.depth_mm.npy, "
      "side.mask.png\n"
      "touchstone capture lat20 --eye-mm 300,0,80 --model lens.yaml --seed 7 -o seen.png\n"
      "touchstone capture lat20 --plan plan.csv -o views/touch.png              views/touch-0000.png, ...",
      [cli, options] { return RunCapture(*cli, *options); });
  command->add_option("OBJECT", options->object, "What to photograph (touchstone objects)")
      ->type_name("")
      ->required();
  cli->AddOutput(command, "-o,--output", &options->output, "The file to write, .png or .jpg; -: stdout, PNG",
                 OutputKind::kPrefix)
      ->required();
  const auto camera = [&](const std::string& name, std::string& value, const std::string& text) {
    command->add_option(name, value, text)->type_name("X,Y,Z")->group("Camera");
  };
  camera("--eye-mm", options->eye_mm, "Where the camera stands, in the object's frame");
  camera("--at-mm", options->at_mm, "What it looks at. Default: the centre of the object's bounding box");
  camera("--up", options->up, "What is up in the picture. Default: 0,0,1");
  cli->AddInput(command,
                command
                    ->add_option("--plan", options->plan,
                                 "The cameras of the touches of a CSV file, or of the rows of a plan of "
                                 "photographs (images.csv) that are of OBJECT")
                    ->type_name("FILE")
                    ->group("Camera"));
  cli->AddInput(command,
                command
                    ->add_option("--model", options->model,
                                 "Model file, name or hash, whose effects of photographs act (shaded "
                                 "style, virtual sources). Default: the source's own")
                    ->type_name("MODEL"));
  command->add_option("--seed", options->seed, "Seed of the pixels' noise. Default: 0")->type_name("N");
  AddTouchOptions(command, "so far that the whole object is in view", &options->touch);
  AddImageOptions(command, &options->image);
  AddMotionOptions(command, &options->motion, false);
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
