// A sphere that moves along a line against one triangle, in double precision.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace touchstone::geometry {

// The point of triangle a b c that is nearest to the coordinates' origin (Ericson, "Real-Time Collision
// Detection", 2005, section 5.1.5).
Eigen::Vector3d NearestPointOfTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                       const Eigen::Vector3d& c);

// First t in [0, max_t] at which the centre t * direction is within `radius` of triangle a b c (corners
// relative to where the centre starts); `touch` is the triangle's point there. False if there is none.
//
// The centres that touch form the triangle moved by the radius to both sides, three cylinders round the edges
// and three spheres round the corners; the first of these that the line enters is the contact.
bool SweepTriangle(const Eigen::Vector3d& direction, double radius, const Eigen::Vector3d& a,
                   const Eigen::Vector3d& b, const Eigen::Vector3d& c, double max_t, double* t,
                   Eigen::Vector3d* touch);

}  // namespace touchstone::geometry
