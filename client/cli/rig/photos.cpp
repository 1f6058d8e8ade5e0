// touchstone rig photos: the fixed sequence of camera poses, once for every way in which the object lies.
#include <algorithm>
#include <cmath>

#include <absl/strings/str_format.h>
#include <Eigen/Geometry>

#include "client/cli/common/progress_bar.h"
#include "client/cli/options/plan_options.h"
#include "client/cli/rig/rig.h"
#include "client/cli/session/image_set.h"
#include "client/source/dataset/batch.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/service/core/convert.h"

namespace touchstone::cli {
namespace {

constexpr double kMargin = 1.05;  // the object's sphere fills the picture but for this
constexpr int kMaxRounds = 1000;

struct PhotosOptions {
  std::string plan;  // a file, in place of the sequence; empty: none
  MotionFlags motion;
  ImageFlags image;
  std::string object, folder, sequence = "ring";
  int turns = 4, rounds = 1;
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

// One picture of the sequence.
struct SequenceView {
  std::string up_face, file;
  int round = 0;
  v1::View view;
  bool wanted = true;  // it does not stand already, and the rig can take it
};

class Photos {
 public:
  Photos(const Cli& cli, const PhotosOptions& options)
      : cli_(cli), options_(options), bar_(!cli.output().quiet) {}

  absl::Status Run() {
    TOUCHSTONE_RETURN_IF_ERROR(OneOf("--sequence", options_.sequence, {"seed", "ring"}).status());
    if (options_.turns < 1 || options_.turns > static_cast<int>(Turns().size()))
      return absl::InvalidArgumentError(absl::StrCat(
          "--turns: ", options_.turns, " is out of range; an object can lie on 1 to 6 of its faces"));
    if (options_.rounds < 1 || options_.rounds > kMaxRounds)
      return absl::InvalidArgumentError(
          absl::StrCat("--rounds: ", options_.rounds, " is out of range; 1 to ", kMaxRounds));
    request_.set_object(options_.object);
    TOUCHSTONE_ASSIGN_OR_RETURN(*request_.mutable_image(), MakeImageSpec(cli_, options_.image, "png"));
    TOUCHSTONE_ASSIGN_OR_RETURN(rig_, ConnectToRig(cli_));
    TOUCHSTONE_RETURN_IF_ERROR(PlanSequence());
    const v1::ImageSpec& image = request_.image();
    TOUCHSTONE_ASSIGN_OR_RETURN(
        set_, ImageSet::Open(options_.folder, {static_cast<int>(image.width()),
                                               static_cast<int>(image.height()), image.vertical_fov_rad()}));
    for (SequenceView& view : views_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool has, set_.Has(view.file));
      view.wanted = !has;
      kept_ += has;
    }
    TOUCHSTONE_RETURN_IF_ERROR(CheckWanted());
    return kept_ + left_out_ == views_.size() ? Finish() : TakeAll();
  }

 private:
  absl::Status PlanSequence() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const v1::ListObjectsResponse objects,
        rig_.connection->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
    std::vector<std::string> names;
    const v1::Object* object = nullptr;
    for (const v1::Object& known : objects.objects()) {
      names.push_back(known.name());
      if (known.name() == options_.object) object = &known;
    }
    TOUCHSTONE_RETURN_IF_ERROR(OneOf("OBJECT", options_.object, names).status());
    const Eigen::Vector3d low = service::FromProto(object->bounds_min_m()),
                          high = service::FromProto(object->bounds_max_m());
    if (!options_.plan.empty()) return PlanFromFile((low + high) / 2);
    const double distance_m =
        kMargin * (high - low).norm() / 2 / std::sin(request_.image().vertical_fov_rad() / 2);
    for (int turn = 0; turn < options_.turns; ++turn) {
      const auto& [face, top] = Turns()[turn];
      // All rounds while the object lies like this; the first one's names are those of a single round.
      for (int round = 0; round < options_.rounds; ++round) {
        const std::string suffix = round == 0 ? "" : absl::StrCat("_round", round);
        int number = 0;
        for (const Ring& ring : RingsOf(options_.sequence))
          for (int k = 0; k < ring.views; ++k, ++number)
            views_.push_back(
                {face, absl::StrFormat("%s_top%s_%02d%s.png", options_.object, face, number, suffix), round,
                 ViewOf((low + high) / 2, distance_m, top, ring.polar_deg * kRadiansPerDegree,
                        2 * kPi * k / ring.views)});
      }
    }
    return absl::OkStatus();
  }

  // The rows of a plan that are of the object, each while that face is up which the camera sees most of.
  absl::Status PlanFromFile(const Eigen::Vector3d& centre) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto pictures, ReadPictures(options_.plan, options_.object));
    if (!pictures.has_value())
      return absl::InvalidArgumentError(absl::StrCat(
          "--plan: ", options_.plan,
          " is no plan of photographs; the columns of images.csv were expected (touchstone propose FOLDER)"));
    for (const auto& [face, top] : Turns())
      for (const PlannedPicture& picture : *pictures) {
        const Eigen::Vector3d from = service::FromProto(picture.view.camera().eye_m()) - centre;
        const auto most = std::max_element(
            Turns().begin(), Turns().end(),
            [&from](const auto& a, const auto& b) { return a.second.dot(from) < b.second.dot(from); });
        if (most->first != face) continue;
        SequenceView view;
        view.up_face = face;
        view.file = picture.file;
        view.view = picture.view;
        views_.push_back(std::move(view));
      }
    return absl::OkStatus();
  }

  // Before anything moves: which views the rig cannot take.
  absl::Status CheckWanted() {
    v1::CheckViewsRequest request;
    request.set_object(options_.object);
    std::vector<SequenceView*> asked;
    for (SequenceView& view : views_) {
      if (!view.wanted) continue;
      *request.add_views() = view.view;
      asked.push_back(&view);
    }
    if (asked.empty()) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::CheckTouchesResponse response,
                                rig_.connection->CallOnce(&v1::Rig::Stub::CheckViews, request));
    if (response.checks_size() != static_cast<int>(asked.size()))
      return absl::InternalError(
          absl::StrCat("the rig answered ", response.checks_size(), " checks of ", asked.size(), " views"));
    Table table({"PICTURE", "WHY THE RIG CANNOT TAKE IT"});
    for (size_t k = 0; k < asked.size(); ++k) {
      if (response.checks(k).possible()) continue;
      asked[k]->wanted = false;
      table.Add({asked[k]->file, response.checks(k).reason()});
      impossible_.push_back({{"file", asked[k]->file}, {"reason", response.checks(k).reason()}});
      ++left_out_;
    }
    if (left_out_ > 0)
      cli_.Warn(absl::StrCat(table.Text(), "\n", left_out_, " of ", Counted(views_.size(), "view", "views"),
                             left_out_ == 1 ? " is" : " are", " left out; nothing has moved yet"));
    return absl::OkStatus();
  }

  absl::Status TakeAll() {
    TOUCHSTONE_ASSIGN_OR_RETURN(source_, OpenLeased(cli_, rig_.connection.get(), options_.motion));
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState rig, GetRig(rig_.connection.get()));
    emulated_ = rig.emulated();
    const StopOnInterrupt stop_on_interrupt(source_.get());
    std::string mounted;
    for (size_t k = 0; k < views_.size(); ++k) {
      const SequenceView& view = views_[k];
      if (!view.wanted) continue;
      if (mounted != view.up_face) {
        bar_.Clear();
        TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig_.connection.get()));
        TOUCHSTONE_RETURN_IF_ERROR(
            MountForTouches(cli_, source_.get(), state, options_.object, view.up_face));
        mounted = view.up_face;
      }
      bar_.ShowStage(absl::StrCat(options_.object, ", face ", view.up_face, " up: ", view.file),
                     static_cast<double>(k) / views_.size());
      TOUCHSTONE_RETURN_IF_ERROR(TakeOne(view));
    }
    bar_.Clear();
    return Finish();
  }

  absl::Status TakeOne(const SequenceView& view) {
    request_.clear_views();
    *request_.add_views() = view.view;
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::CaptureResponse response, source_->Capture(request_));
    if (response.columns_size() != 1 || response.columns(0).type() != v1::DATA_TYPE_BYTES ||
        response.photographs_size() != 1)
      return absl::InternalError("the source did not send one encoded picture with its pose");
    TOUCHSTONE_RETURN_IF_ERROR(client::ValidateColumn(response.columns(0), response.rows()));
    // The row first: interrupted in between, a row without its picture is taken again.
    TOUCHSTONE_RETURN_IF_ERROR(set_.Add(
        {view.file, options_.object, view.round, view.view.camera(), response.photographs(0), emulated_}));
    return cli_.Write(set_.PathOf(view.file), client::FileOf(response.columns(0), 0));
  }

  absl::Status Finish() const {
    Json files = Json::array();
    for (const SequenceView& view : views_)
      if (set_.Has(view.file).value_or(false)) files.push_back(set_.PathOf(view.file));
    if (cli_.output().json)
      PrintJson({{"files", files},
                 {"images", set_.PathOf("images.csv")},
                 {"camera", set_.PathOf("camera.yaml")},
                 {"kept", kept_},
                 {"left_out", left_out_},
                 {"impossible", impossible_}});
    cli_.Log(absl::StrCat(
        options_.folder, ": ", Counted(files.size(), "picture", "pictures"),
        kept_ > 0 ? absl::StrCat(", ", kept_, " of them stood already") : "",
        left_out_ > 0 ? absl::StrCat("; ", left_out_, " that the rig cannot take are left out") : "",
        "; poses in images.csv, intrinsics in camera.yaml",
        emulated_ ? "; an emulator took them: they measure nothing" : ""));
    if (files.empty()) return absl::FailedPreconditionError("the rig can take none of these pictures");
    return absl::OkStatus();
  }

  const Cli& cli_;
  const PhotosOptions& options_;
  ProgressBar bar_;
  RigConnection rig_;
  std::unique_ptr<client::LeasedSource> source_;
  v1::CaptureRequest request_;
  std::vector<SequenceView> views_;  // in the order in which they are taken
  ImageSet set_;
  size_t kept_ = 0, left_out_ = 0;
  Json impossible_ = Json::array();  // what is left out, and why
  bool emulated_ = false;
};

}  // namespace

void AddRigPhotos(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<PhotosOptions>();
  CLI::App* command =
      cli->AddCommand(group, "photos",
                      "Photographs an object in a fixed sequence of camera poses, and asks "
                      "for it to be turned in between. Pictures "
                      "that stand already are not taken again. The folder is an image set "
                      "for compare, diagnose and session import: images.csv has the commanded and the "
                      "measured pose of each, its time and its round, camera.yaml the intrinsics.",
                      "touchstone rig photos lat20 -o photos --server 127.0.0.1:50052\n"
                      "touchstone rig photos lat20 -o photos --sequence seed --turns 6 "
                      "--image 640x480 --server 127.0.0.1:50052\n"
                      "touchstone rig photos lat20 -o photos --rounds 3 --server 127.0.0.1:50052\n"
                      "touchstone compare photos --model nominal.yaml --mesh-dir meshes",
                      [cli, options] { return Photos(*cli, *options).Run(); });
  command->add_option("OBJECT", options->object, "What to photograph (touchstone objects)")
      ->type_name("")
      ->required();
  cli->AddOutput(command, "-o,--output", &options->folder,
                 "The folder for the pictures; those that are there are kept", OutputKind::kFolder)
      ->required();
  cli->AddInput(command,
                command
                    ->add_option("--plan", options->plan,
                                 "In place of the sequence the rows of a plan of photographs that are of "
                                 "OBJECT (touchstone propose FOLDER -o FILE)")
                    ->type_name("FILE"));
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
  command
      ->add_option("--rounds", options->rounds,
                   "How often each view is taken; repeats tell the noise floor. Default: 1")
      ->type_name("N");
  AddImageOptions(command, &options->image);
  AddMotionOptions(command, &options->motion, false);
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
