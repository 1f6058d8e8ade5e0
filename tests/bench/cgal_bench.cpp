// CGAL's AABB tree on the same object and lines: first intersections of three rays per touch, one thread, in
// the order of the samples. One JSON object on stdout.
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/version.h>

#include <chrono>
#include <cstdio>

#include "tests/bench/scene.h"

int main() {
  using namespace touchstone::bench;
  using Kernel = CGAL::Simple_cartesian<double>;
  using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
  using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<Mesh>>>;
  const auto specification = Touches(Lat20(), "");
  const auto& source = specification->objects[0]->mesh();
  Mesh mesh;
  for (const auto& v : source.vertices_m) mesh.add_vertex(Kernel::Point_3(v.x(), v.y(), v.z()));
  for (const auto& t : source.triangles)
    mesh.add_face(Mesh::Vertex_index(t[0]), Mesh::Vertex_index(t[1]), Mesh::Vertex_index(t[2]));
  Tree tree(faces(mesh).first, faces(mesh).second, mesh);
  tree.build();
  const auto poses = AcceptedPoses(*specification, 20000);
  size_t hits = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (const auto& pose : poses) {
    for (int finger = -1; finger <= 1; ++finger) {
      const Eigen::Vector3d o =
          pose.target_m - pose.approach * pose.standoff_m + pose.lateral * (0.03 * finger);
      const Kernel::Ray_3 ray(Kernel::Point_3(o.x(), o.y(), o.z()),
                              Kernel::Vector_3(pose.approach.x(), pose.approach.y(), pose.approach.z()));
      hits += tree.first_intersection(ray).has_value();
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (hits < poses.size() * 3 * 99 / 100) return 1;
  std::printf("{\"touches_per_s\": %.0f, \"version\": \"CGAL %s\"}\n", poses.size() / seconds,
              CGAL_VERSION_STR);
}
