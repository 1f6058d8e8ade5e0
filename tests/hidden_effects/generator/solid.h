// A triangle mesh that lines and spheres are cast against, in double precision, millimetres: the oracle's own casting.
// It shares nothing with the product's: no Embree, no single precision, no packets; a median-split tree of
// boxes, and exact tests against every face, edge and vertex that a box lets through.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace touchstone::hidden {

struct Triangles {
  std::vector<Eigen::Vector3d> vertices_mm;
  std::vector<std::array<uint32_t, 3>> corners;
};

// From the product's mesh reader: the file's triangles and nothing else.
Triangles ReadTriangles(const std::string& off_path);
// A named supershape of the product ("lat10"), where no file is at hand.
Triangles SupershapeTriangles(const std::string& name, uint64_t triangles = 65'000);

struct Contact {
  double travel_mm = 0;  // of the foremost point of the tip
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();  // unit, from the contact towards the tip
  bool hit = false;
};

class Solid {
 public:
  Solid(std::string name, Triangles triangles);

  const std::string& name() const { return name_; }
  const Triangles& triangles() const { return triangles_; }
  const Eigen::Vector3d& low_mm() const { return boxes_[0].low; }
  const Eigen::Vector3d& high_mm() const { return boxes_[0].high; }

  // First contact of a sphere of this radius (0: a point) whose foremost point starts at `origin` and moves along the
  // unit vector `direction`. A sphere that overlaps the solid where it starts counts as a miss.
  Contact FirstContact(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                       double radius_mm) const;

  // The same by trying every triangle.
  Contact FirstContactOfAll(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                            double radius_mm) const;

 private:
  struct Box {
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = Eigen::Vector3d::Constant(-1e300);
    uint32_t left = 0, right = 0;  // children; of a leaf both 0
    uint32_t begin = 0, end = 0;   // of a leaf: range of order_
  };
  uint32_t Build(uint32_t begin, uint32_t end);
  void TryTriangle(uint32_t triangle, const Eigen::Vector3d& centre, const Eigen::Vector3d& direction,
                   double radius_mm, Contact* best) const;

  std::string name_;
  Triangles triangles_;
  std::vector<uint32_t> order_;
  std::vector<Box> boxes_;  // the root first
};

}  // namespace touchstone::hidden
