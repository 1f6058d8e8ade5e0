// touchstone rig photos: the fixed sequence of camera poses, once for every way in which the object lies.
#include <cmath>
#include <filesystem>

#include <Eigen/Geometry>

#include "client/cli/plan_options.h"
#include "client/cli/progress_bar.h"
#include "client/cli/rig.h"
#include "client/source/batch.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/base/units.h"
#include "server/service/convert.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kMargin = 1.05;  // the object's sphere fills the picture but for this

struct PhotosOptions {
  MotionFlags motion;
  ImageFlags image;
  std::string object, folder, sequence = "ring";
  int turns = 4;
};

// Angles of a ring of views from straight above, and how many stand on it. All lie well within 45 deg, so
// that every view comes from above while the object lies the same way.
struct Ring {
  double polar_deg;
  int views;
};
const std::vector<Ring>& RingsOf(const std::string& sequence) {
  static const std::vector<Ring> ring = {{0, 1}, {20, 6}, {40, 12}};
  // The seed's steps: every 30 deg round, at 60 deg above the horizon.
  static const std::vector<Ring> seed = {{30, 12}};
  return sequence == "seed" ? seed : ring;
}

const std::vector<std::pair<std::string, Eigen::Vector3d>>& Turns() {
  static const std::vector<std::pair<std::string, Eigen::Vector3d>> turns = {
      {"+z", Eigen::Vector3d::UnitZ()},  {"+x", Eigen::Vector3d::UnitX()}, {"-z", -Eigen::Vector3d::UnitZ()},
      {"-x", -Eigen::Vector3d::UnitX()}, {"+y", Eigen::Vector3d::UnitY()}, {"-y", -Eigen::Vector3d::UnitY()}};
  return turns;
}

v1::View ViewOf(const Eigen::Vector3d& centre, double distance_m, const Eigen::Vector3d& top,
                double polar_rad, double azimuth_rad) {
  const Eigen::Vector3d u = top.unitOrthogonal(), v = top.cross(u);
  const Eigen::Vector3d round = std::cos(azimuth_rad) * u + std::sin(azimuth_rad) * v;
  v1::View view;
  v1::CameraPose* camera = view.mutable_camera();
  *camera->mutable_eye_m() = service::ToProto(
      Eigen::Vector3d(centre + distance_m * (std::cos(polar_rad) * top + std::sin(polar_rad) * round)));
  *camera->mutable_at_m() = service::ToProto(centre);
  // From straight above there is no up but the ring's own.
  *camera->mutable_up() = service::ToProto(polar_rad > 0 ? top : Eigen::Vector3d(-round));
  return view;
}

absl::Status RunPhotos(const Cli& cli, const PhotosOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--sequence", options.sequence, {"seed", "ring"}).status());
  if (options.turns < 1 || options.turns > static_cast<int>(Turns().size()))
    return absl::InvalidArgumentError(absl::StrCat(
        "--turns: ", options.turns, " is out of range; an object can lie on 1 to 6 of its faces"));
  v1::CaptureRequest request;
  request.set_object(options.object);
  TOUCHSTONE_ASSIGN_OR_RETURN(*request.mutable_image(), MakeImageSpec(cli, options.image, "png"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse objects,
                              client::Connection::Call(&v1::Source::Stub::ListObjects,
                                                       rig.connection->source(), v1::ListObjectsRequest()));
  std::vector<std::string> names;
  const v1::Object* object = nullptr;
  for (const v1::Object& known : objects.objects()) {
    names.push_back(known.name());
    if (known.name() == options.object) object = &known;
  }
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("OBJECT", options.object, names).status());
  const Eigen::Vector3d low = service::FromProto(object->bounds_min_m()),
                        high = service::FromProto(object->bounds_max_m());
  const double distance_m =
      kMargin * (high - low).norm() / 2 / std::sin(request.image().vertical_fov_rad() / 2);

  std::error_code error;
  fs::create_directories(options.folder, error);
  if (error)
    return absl::InvalidArgumentError(
        absl::StrCat("-o: ", options.folder, " cannot be made: ", error.message()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, rig.connection.get(), options.motion));
  const StopOnInterrupt stop_on_interrupt(source.get());
  ProgressBar bar(!cli.output().quiet);
  Json files = Json::array();
  size_t kept = 0, left_out = 0;
  size_t views_a_turn = 0;
  for (const Ring& ring : RingsOf(options.sequence)) views_a_turn += ring.views;
  for (int turn = 0; turn < options.turns; ++turn) {
    const auto& [face, top] = Turns()[turn];
    bool mounted = false;
    int number = 0;
    for (const Ring& ring : RingsOf(options.sequence)) {
      for (int k = 0; k < ring.views; ++k, ++number) {
        char name[32];
        std::snprintf(name, sizeof name, "_top%s_%02d.png", face.c_str(), number);
        const std::string path = (fs::path(options.folder) / (options.object + name)).string();
        files.push_back(path);
        // A picture that stands already is not taken again.
        if (fs::exists(path, error)) {
          ++kept;
          continue;
        }
        if (!mounted) {
          bar.Clear();
          TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
          TOUCHSTONE_RETURN_IF_ERROR(MountForTouches(cli, source.get(), state, options.object, face));
          mounted = true;
        }
        bar.ShowStage(absl::StrCat(options.object, ", face ", face, " up: picture ", number + 1),
                      (turn + static_cast<double>(number) / views_a_turn) / options.turns);
        request.clear_views();
        *request.add_views() = ViewOf((low + high) / 2, distance_m, top, ring.polar_deg * kRadiansPerDegree,
                                      2 * kPi * k / ring.views);
        const absl::StatusOr<v1::CaptureResponse> captured = source->Capture(request);
        // Where the arm cannot take the camera there is no picture; the others stand for themselves.
        if (absl::IsOutOfRange(captured.status()) || absl::IsInvalidArgument(captured.status())) {
          bar.Clear();
          cli.Log(absl::StrCat("no ", path, ": ", captured.status().message()));
          files.erase(files.size() - 1);
          ++left_out;
          continue;
        }
        TOUCHSTONE_RETURN_IF_ERROR(captured.status());
        const v1::CaptureResponse& response = *captured;
        if (response.columns_size() != 1 || response.columns(0).type() != v1::DATA_TYPE_BYTES)
          return absl::InternalError("the source did not send one encoded picture");
        TOUCHSTONE_RETURN_IF_ERROR(client::ValidateColumn(response.columns(0), response.rows()));
        TOUCHSTONE_RETURN_IF_ERROR(cli.Write(path, client::FileOf(response.columns(0), 0)));
      }
    }
  }
  bar.Clear();
  if (cli.output().json) PrintJson({{"files", files}, {"kept", kept}, {"left_out", left_out}});
  cli.Log(absl::StrCat(
      options.folder, ": ", Counted(files.size(), "picture", "pictures"),
      kept > 0 ? absl::StrCat(", ", kept, " of them stood already") : "",
      left_out > 0 ? absl::StrCat("; ", left_out, " that the rig cannot take are left out") : ""));
  if (files.empty()) return absl::FailedPreconditionError("the rig can take none of these pictures");
  return absl::OkStatus();
}

}  // namespace

void AddRigPhotos(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<PhotosOptions>();
  CLI::App* command = cli->AddCommand(group, "photos",
                                      "Photographs an object in a fixed sequence of camera poses, and asks "
                                      "for it to be turned in between. Pictures "
                                      "that stand already are not taken again.",
                                      "touchstone rig photos lat20 -o photos --server 127.0.0.1:50052\n"
                                      "touchstone rig photos lat20 -o photos --sequence seed --turns 6 "
                                      "--image 640x480 --server 127.0.0.1:50052",
                                      [cli, options] { return RunPhotos(*cli, *options); });
  command->add_option("OBJECT", options->object, "What to photograph (touchstone objects)")
      ->type_name("")
      ->required();
  cli->AddOutput(command, "-o,--output", &options->folder,
                 "The folder for the pictures; those that are there are kept", OutputKind::kFolder)
      ->required();
  command
      ->add_option(
          "--sequence", options->sequence,
          "ring: 19 views, one from above and rings at 20 and 40 deg from it; seed: 12 views every 30 deg at "
          "30 deg from above. Default: ring")
      ->type_name("KIND");
  command
      ->add_option("--turns", options->turns,
                   "On how many of its faces the object is laid, 1 to 6. Default: 4")
      ->type_name("N");
  AddImageOptions(command, &options->image);
  AddMotionOptions(command, &options->motion, false);
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
