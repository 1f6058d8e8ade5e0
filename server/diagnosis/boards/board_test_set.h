// Pictures of a board by a camera whose lens is known, with corners that scatter. For tests only.
#pragma once

#include <cmath>

#include <Eigen/Geometry>

#include "server/base/numbers/random.h"
#include "server/diagnosis/boards/board_pose.h"
#include "server/diagnosis/boards/board_set.h"
#include "server/diagnosis/boards/lens.h"

namespace touchstone::diagnosis::boards {

// What a lens differs from the nominal one by; zero: the nominal lens.
enum LensEntry { kFocal, kOffsetX, kOffsetY, kK1, kK2, kP1, kP2, kK3, kAspect, kLensEntries };
using LensVector = Eigen::Matrix<double, kLensEntries, 1>;

inline session::CameraIntrinsics CameraWith(session::CameraIntrinsics nominal, const LensVector& lens) {
  nominal.fx_px *= (1 + lens[kFocal]) * (1 + lens[kAspect]);
  nominal.fy_px *= 1 + lens[kFocal];
  nominal.cx_px += lens[kOffsetX], nominal.cy_px += lens[kOffsetY];
  nominal.k1 += lens[kK1], nominal.k2 += lens[kK2], nominal.k3 += lens[kK3];
  nominal.p1 += lens[kP1], nominal.p2 += lens[kP2];
  return nominal;
}

inline image::PhotoLens PhotoLensOf(const session::CameraIntrinsics& camera) {
  return LensOfModel(camera, model::NominalModel());
}

inline BoardSet MakeBoardSet(const LensVector& lens, int pictures, double sigma_px, uint64_t seed) {
  BoardSet set;
  set.board = {9, 6, 0.025};
  set.camera = {640, 480, 540, 540, 320, 240};
  RandomStream random(seed, RandomDomain::kTest);
  while (static_cast<int>(set.pictures.size()) < pictures) {
    BoardPose pose;
    // Tilted by up to 35 deg, the board's middle before the camera.
    const Eigen::Vector3d turn(random.Uniform(-0.6, 0.6), random.Uniform(-0.6, 0.6),
                               random.Uniform(-0.4, 0.4));
    pose.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    const Eigen::Vector3d middle(0.1, 0.0625, 0);
    pose.translation_m =
        Eigen::Vector3d(random.Uniform(-0.08, 0.08), random.Uniform(-0.05, 0.05), random.Uniform(0.3, 0.5)) -
        pose.rotation * middle;
    BoardPicture picture;
    picture.file = std::to_string(set.pictures.size()) + ".png";
    bool inside = true;
    for (int corner = 0; corner < set.board.corners(); ++corner) {
      ProjectedCorner projected;
      inside = inside &&
               ProjectCorner(PhotoLensOf(CameraWith(set.camera, lens)), pose, set.board.CornerM(corner),
                             &projected) &&
               projected.px.minCoeff() > 0 && projected.px.x() < 640 && projected.px.y() < 480;
      picture.corners_px.push_back(projected.px +
                                   sigma_px * Eigen::Vector2d(random.Normal(), random.Normal()));
    }
    if (inside) set.pictures.push_back(std::move(picture));
  }
  return set;
}

inline LensVector LensWith(std::initializer_list<std::pair<LensEntry, double>> values) {
  LensVector lens = LensVector::Zero();
  for (const auto& [entry, value] : values) lens[entry] = value;
  return lens;
}

// Every entry differs from the nominal lens, by about what lenses do.
inline LensVector LensOfAllEntries() {
  return LensWith({{kFocal, 0.03},
                   {kOffsetX, 4},
                   {kOffsetY, -6},
                   {kK1, -0.25},
                   {kK2, 0.1},
                   {kP1, 0.004},
                   {kP2, -0.003},
                   {kK3, -0.05},
                   {kAspect, 0.01}});
}

}  // namespace touchstone::diagnosis::boards
