#include "server/image/photograph/simulate_photo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <list>
#include <mutex>
#include <utility>

#include <absl/strings/str_format.h>

#include "server/base/status.h"
#include "server/effects/touch_batch.h"
#include "server/image/photograph/photo_lens.h"
#include "server/image/photograph/photo_light.h"
#include "server/image/photograph/photo_points.h"
#include "server/image/photograph/photo_sensor.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/shading_mesh.h"

namespace touchstone::image {
// Where the pixels look, which costs a few Newton steps each where the lens distorts: photographs through one lens
// share it, also those of other threads.
struct LensView {
  PixelSlopes slopes;
  bool sees = false;
};

namespace {

std::shared_ptr<const ShadingMesh> SharedShadingMesh(
    const std::shared_ptr<const geometry::Surface>& surface) {
  static ShadingMeshCache& meshes = *new ShadingMeshCache;
  return meshes.Get(surface);
}

// What a stage's result depends on, as numbers that are compared one by one.
using StageKey = std::vector<double>;

void Append(const Eigen::Vector3d& v, StageKey* key) {
  key->insert(key->end(), v.data(), v.data() + 3);
}

StageKey KeyOfLens(const PhotoLens& lens) {
  StageKey key = {static_cast<double>(lens.width), static_cast<double>(lens.height)};
  for (double number : lens.Numbers()) key.push_back(number);
  return key;
}

StageKey KeyOfPoints(const PhotoCamera& camera, const StageKey& lens) {
  StageKey key = lens;
  for (const Eigen::Vector3d& v : {camera.eye_m, camera.right, camera.up, camera.forward}) Append(v, &key);
  key.insert(key.end(), {camera.near_m, camera.far_m, camera.scale});
  return key;
}

class LensViewCache {
 public:
  std::shared_ptr<const LensView> Get(const PhotoLens& lens, const StageKey& key) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      const auto found =
          std::find_if(views_.begin(), views_.end(), [&](const auto& entry) { return entry.first == key; });
      if (found != views_.end()) {
        views_.splice(views_.begin(), views_, found);
        return found->second;
      }
    }
    auto view = std::make_shared<LensView>();
    FillSlopes(lens, &view->slopes, &view->sees);
    std::lock_guard<std::mutex> lock(mutex_);
    views_.emplace_front(key, view);
    size_t pixels = 0;
    for (auto entry = views_.begin(); entry != views_.end();) {
      pixels += entry->second->slopes.up.size();
      entry = pixels > kMaxPixels && entry != views_.begin() ? views_.erase(entry) : std::next(entry);
    }
    return view;
  }

 private:
  static constexpr size_t kMaxPixels = size_t{1} << 22;  // 32 MiB, 80 lenses of 224 x 224 pixels

  std::mutex mutex_;
  std::list<std::pair<StageKey, std::shared_ptr<const LensView>>> views_;  // the last used first
};

std::shared_ptr<const LensView> SharedLensView(const PhotoLens& lens, const StageKey& key) {
  static LensViewCache& views = *new LensViewCache;
  return views.Get(lens, key);
}

SurfacePlace PlaceOf(const model::Model& model, const std::string& object) {
  SurfacePlace place;
  bool moved = false;
  for (const model::EffectInstance& instance : model.effects) moved |= instance.effect->moves_surface;
  if (!moved) return place;
  effects::TouchBatch batch;
  batch.Reset(1, model.fingers);
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->moves_surface) instance.effect->apply(instance.ValuesFor(object), batch);
  place.scale = batch.surface_scale;
  place.rotation = batch.surface_rotation;
  place.translation_m = batch.surface_translation_m;
  return place;
}

absl::Status CheckRequest(const PhotoRequest& request) {
  if (request.surface == nullptr)
    return absl::InvalidArgumentError("a photograph needs a surface to look at");
  TOUCHSTONE_RETURN_IF_ERROR(CheckLens(request.lens));
  Camera camera = request.camera;
  camera.vertical_fov_rad = Camera().vertical_fov_rad;  // the lens counts
  ImageOptions options;
  options.width = request.lens.width, options.height = request.lens.height;
  TOUCHSTONE_RETURN_IF_ERROR(ValidateImageRequest(camera, options));
  if (!std::isfinite(request.session_time_s))
    return absl::InvalidArgumentError(absl::StrFormat(
        "session_time_s of a photograph is %g; must be a finite number", request.session_time_s));
  return absl::OkStatus();
}

// A value per visible point, spread over the picture.
void Scatter(const PhotoPoints& points, const std::vector<float>& values, float background, size_t pixels,
             std::vector<float>* picture) {
  picture->assign(pixels, background);
  for (int i = 0; i < points.count; ++i) (*picture)[points.pixel[i]] = values[i];
}

std::vector<float> Incidences(const PhotoPoints& points) {
  std::vector<float> incidence_rad(points.depth_m.size());
  for (int i = 0; i < points.count; ++i) incidence_rad[i] = std::acos(points.cos_incidence[i]);
  return incidence_rad;
}

}  // namespace

struct PhotoWorkspace::Kept {
  std::shared_ptr<const geometry::Surface> surface;
  std::shared_ptr<const ShadingMesh> mesh;
  StageKey lens_key, points_key, lamps_key;
  std::shared_ptr<const LensView> lens_view;
  PhotoPoints points;
  PhotoLamps lamps;
  std::vector<float> light;  // of the points

  // Each brings what it names up to date, and what stands on it is forgotten where it changed.
  void UseSurface(const std::shared_ptr<const geometry::Surface>& wanted) {
    if (surface == wanted) return;
    surface = wanted;
    mesh = SharedShadingMesh(wanted);
    points_key.clear(), lamps_key.clear();
  }
  void UseLens(const PhotoLens& lens) {
    const StageKey key = KeyOfLens(lens);
    if (key == lens_key) return;
    lens_view = SharedLensView(lens, key);
    lens_key = key;
    points_key.clear(), lamps_key.clear();
  }
  void UseCamera(const PhotoCamera& camera, const PhotoLens& lens) {
    const StageKey key = KeyOfPoints(camera, lens_key);
    if (key == points_key) return;
    FindPoints(*surface, *mesh, camera, lens, lens_view->slopes, &points);
    points_key = key;
    lamps_key.clear();
  }
  void UseLamps(const LampPlaces& places, bool shadows) {
    StageKey key;
    Append(places.key_m, &key), Append(places.fill_m, &key);
    if (key != lamps_key) {
      FindLamps(points, places, &lamps);
      lamps_key = key;
    }
    if (shadows && lamps.in_shadow.empty()) FindShadows(*surface, points, places, &lamps);
  }
};

PhotoWorkspace::PhotoWorkspace() : kept_(std::make_unique<Kept>()) {}
PhotoWorkspace::~PhotoWorkspace() = default;

PhotoSimulator::PhotoSimulator(std::shared_ptr<const model::Model> model) : model_(std::move(model)) {}
PhotoSimulator::~PhotoSimulator() = default;

effects::PhotoSettings PhotoSimulator::SettingsFor(const std::string& object) const {
  effects::PhotoSettings settings;
  for (const model::Stage stage : {model::Stage::kCameraPose, model::Stage::kProjection,
                                   model::Stage::kShading, model::Stage::kImageSensor})
    for (const model::EffectInstance& instance : model_->effects)
      if (instance.effect->stage == stage && instance.effect->apply_to_photo)
        instance.effect->apply_to_photo(instance.ValuesFor(object), settings);
  return settings;
}

std::vector<Eigen::Vector2d> PhotoSimulator::Project(const PhotoRequest& request,
                                                     const std::vector<Eigen::Vector3f>& points_m) const {
  const effects::PhotoSettings settings = SettingsFor(request.object);
  const PhotoLens lens = EffectiveLens(request.lens, settings);
  const PhotoCamera camera =
      RealCamera(request.camera, settings, PlaceOf(*model_, request.object), request.surface->bounds());
  std::vector<Eigen::Vector2d> pixels;
  pixels.reserve(points_m.size());
  for (const Eigen::Vector3f& point_m : points_m) {
    const Eigen::Vector3d way = point_m.cast<double>() - camera.eye_m;
    const Eigen::Vector3d in_camera(way.dot(camera.right), -way.dot(camera.up), way.dot(camera.forward));
    pixels.push_back(in_camera.z() > 0 ? lens.Project(in_camera)
                                       : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  }
  return pixels;
}

absl::StatusOr<Photo> PhotoSimulator::Run(const PhotoRequest& request, const PhotoOutputs& outputs,
                                          PhotoWorkspace* workspace) const {
  TOUCHSTONE_RETURN_IF_ERROR(CheckRequest(request));
  PhotoWorkspace own;
  PhotoWorkspace::Kept& kept = *(workspace != nullptr ? workspace : &own)->kept_;
  const effects::PhotoSettings settings = SettingsFor(request.object);
  if (!settings.formula_error.empty()) return absl::InvalidArgumentError(settings.formula_error);
  const SurfacePlace place = PlaceOf(*model_, request.object);
  const PhotoLens lens = EffectiveLens(request.lens, settings);
  const geometry::Bounds& bounds = request.surface->bounds();

  kept.UseSurface(request.surface);
  kept.UseLens(lens);
  if (!kept.lens_view->sees)
    return absl::InvalidArgumentError(absl::StrFormat(
        "the lens sees nothing: with fx %g px, k1 %g and k2 %g no pixel of %d x %d has a viewing ray",
        lens.fx, lens.k1, lens.k2, lens.width, lens.height));
  kept.UseCamera(RealCamera(request.camera, settings, place, bounds), lens);
  kept.UseLamps(PlaceLamps(request.camera, bounds, settings, place), settings.shadow_strength > 0);
  FillLight(kept.points, kept.lamps, settings, &kept.light);

  Photo photo;
  photo.width = lens.width, photo.height = lens.height;
  const size_t pixels = static_cast<size_t>(lens.width) * lens.height;
  const PhotoPoints& points = kept.points;
  Scatter(points, kept.light, static_cast<float>(settings.background_light), pixels, &photo.grey);
  photo.mask.assign(pixels, 0);
  for (int i = 0; i < points.count; ++i) photo.mask[points.pixel[i]] = 255;
  PixelSurface surface;
  if (!settings.added_grey.empty()) {
    Scatter(points, Incidences(points), static_cast<float>(0.5 * kPi), pixels, &surface.incidence_rad);
    Scatter(points, points.depth_m, 0.0f, pixels, &surface.depth_m);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(
      photo.varied, RecordLight(settings, lens, surface, request.session_time_s, points.box, &photo.grey));
  if (outputs.pixels) DrawPixels(settings, photo.grey, request.seed, request.index, &photo.pixels);
  if (outputs.details) {
    Scatter(points, points.depth_m, 0.0f, pixels, &photo.depth_m);
    Scatter(points, Incidences(points), 0.0f, pixels, &photo.incidence_rad);
    Scatter(points, kept.light, 0.0f, pixels, &photo.light);
    photo.point_m.assign(pixels, Eigen::Vector3f::Zero());
    for (int i = 0; i < points.count; ++i)
      photo.point_m[points.pixel[i]] = {points.point_m[0][i], points.point_m[1][i], points.point_m[2][i]};
  }
  return photo;
}

}  // namespace touchstone::image
