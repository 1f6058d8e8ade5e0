// Damaged files: cut off anywhere, one byte changed anywhere. Readers must answer, with a mesh that holds
// together or with a reason; run under the sanitizers this also shows that they touch no byte but the file's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <filesystem>

#include "server/base/numbers/random.h"
#include "server/base/test_paths.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

using Clock = std::chrono::steady_clock;

struct Seed {
  std::string name;
  std::string format;
  std::string bytes;
};

std::string F32(float value) {
  return std::string(reinterpret_cast<const char*>(&value), 4);
}

std::string BinaryStl() {
  std::string bytes = "solid but binary";
  bytes.resize(80, ' ');
  bytes += std::string("\x02\0\0\0", 4);
  for (int t = 0; t < 2; ++t) {
    for (float value : {0, 0, 1, 0, 0, 0, 1, 0, 0, t, 1, 0}) bytes += F32(value);
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string BinaryPly() {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uchar ushort vertex_index\n"
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  bytes += std::string("\x04\0\0\x01\0\x02\0\x03\0", 9);
  for (float value : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) bytes += F32(value);
  return bytes;
}

// One small file of each format, and the small ones of the corpus where it is at hand.
std::vector<Seed> Seeds() {
  std::vector<Seed> seeds = {
      {"tetrahedron", "off",
       "OFF\n4 4 6 # counts\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2 255 0 0\n"},
      {"concave", "obj",
       "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 .5 0\nv 0 2 0\nvt 0 0\ng a\nf 1/1 2/1 3/1 \\\n 4/1 5/1\nf -1 -2 -3\n"},
      {"text", "stl",
       "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
       "0\nendloop\nendfacet\nendsolid a\n"},
      {"binary", "stl", BinaryStl()},
      {"text", "ply",
       "ply\nformat ascii 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty double y\nproperty "
       "int z\n"
       "element face 1\nproperty list uchar int vertex_indices\nproperty uchar red\nend_header\n"
       "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 7\n"},
      {"binary", "ply", BinaryPly()},
  };
  const std::string corpus = SharedData() + "/meshes";
  if (!std::filesystem::exists(corpus)) return seeds;
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(corpus))
    if (entry.is_regular_file() && entry.file_size() < 20'000 && entry.path().extension() != ".tsv")
      paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  for (const auto& path : paths) {
    std::string format = path.extension().string().substr(1);
    for (char& c : format) c = static_cast<char>(std::tolower(c));
    const absl::StatusOr<std::string> bytes = ReadFile(path);
    if (bytes.ok()) seeds.push_back({path.string(), format, *bytes});
  }
  return seeds;
}

// Reads, and checks what must hold of every answer.
void ReadDamaged(const Seed& seed, const std::string& bytes) {
  const absl::StatusOr<TriangleMesh> mesh = ReadMeshBytes(seed.name, seed.format, bytes);
  if (!mesh.ok()) {
    ASSERT_THAT(std::string(mesh.status().message()), testing::StartsWith(seed.name + ": "));
    return;
  }
  ASSERT_FALSE(mesh->triangles.empty());
  for (const auto& triangle : mesh->triangles)
    for (uint32_t corner : triangle) ASSERT_LT(corner, mesh->vertices_m.size());
  for (const Eigen::Vector3f& vertex_m : mesh->vertices_m) ASSERT_TRUE(vertex_m.allFinite());
  // No more than the bytes can say: a face of n corners takes n bytes and more.
  ASSERT_LE(mesh->triangles.size(), bytes.size());
  ASSERT_LE(mesh->vertices_m.size(), bytes.size());
}

int64_t PeakMemoryKib() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

class MeshMutation : public testing::Test {
 protected:
  // Calls damage(seed, random) in turn for all seeds until `rounds` are done or the time is up.
  template <typename F>
  void ForSomeSeconds(double seconds, F damage) {
    const std::vector<Seed> seeds = Seeds();
    const Clock::time_point end =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
    const int64_t before_kib = PeakMemoryKib();
    for (uint64_t round = 0; round < 400 && Clock::now() < end; ++round) {
      for (size_t s = 0; s < seeds.size(); ++s) {
        RandomStream random(1, RandomDomain::kTest, s, round);
        const Clock::time_point start = Clock::now();
        damage(seeds[s], &random);
        if (HasFatalFailure()) FAIL() << seeds[s].name << ", round " << round;
        ASSERT_LT(Clock::now() - start, std::chrono::seconds(10)) << seeds[s].name << ", round " << round;
      }
    }
    EXPECT_LT(PeakMemoryKib() - before_kib, 256 << 10) << "files of 20 kB took more than 256 MiB";
  }
};

TEST_F(MeshMutation, CutOffFilesAreAnswered) {
  ForSomeSeconds(1.5, [](const Seed& seed, RandomStream* random) {
    ReadDamaged(seed, seed.bytes.substr(0, random->Below(seed.bytes.size() + 1)));
  });
}

TEST_F(MeshMutation, FilesWithOneWrongByteAreAnswered) {
  ForSomeSeconds(1.5, [](const Seed& seed, RandomStream* random) {
    if (seed.bytes.empty()) return;
    std::string bytes = seed.bytes;
    // Half of the time among the first bytes: the header.
    const uint64_t within = random->Below(2) == 0 ? std::min<uint64_t>(bytes.size(), 300) : bytes.size();
    bytes[random->Below(within)] = static_cast<char>(random->Below(256));
    ReadDamaged(seed, bytes);
  });
}

TEST_F(MeshMutation, FilesWithAWrongDigitAreAnswered) {
  ForSomeSeconds(1.5, [](const Seed& seed, RandomStream* random) {
    std::string bytes = seed.bytes;
    std::vector<size_t> digits;
    for (size_t i = 0; i < bytes.size() && digits.size() < 2000; ++i)
      if (bytes[i] >= '0' && bytes[i] <= '9') digits.push_back(i);
    if (digits.empty()) return;
    // A number becomes huge, negative or something else: the classical damage to counts and indices.
    static const char* const kInstead[] = {
        "99999999999999999999", "4294967295", "2147483648", "1000000000000", "-1",
        "-9223372036854775808", "1e308",      "nan",        "65536",         ""};
    bytes.replace(digits[random->Below(digits.size())], 1, kInstead[random->Below(10)]);
    ReadDamaged(seed, bytes);
  });
}

TEST_F(MeshMutation, EveryTruncationOfACompleteTextFileIsRefused) {
  // Whatever is missing of these files, the header's promise or a closing word is broken; only white space
  // and the last face's colour may go unnoticed.
  for (const Seed& seed : Seeds()) {
    if (seed.name != "tetrahedron" && seed.name != "text" && seed.name != "binary") continue;
    const size_t may_miss = seed.format == "off" ? sizeof " 255 0 0\n" - 1 : seed.format == "stl" ? 3 : 3;
    for (size_t size = 0; size + may_miss < seed.bytes.size(); ++size)
      ASSERT_FALSE(ReadMeshBytes(seed.name, seed.format, seed.bytes.substr(0, size)).ok())
          << seed.name << " " << seed.format << " cut off after " << size << " bytes";
  }
}

}  // namespace
}  // namespace touchstone::geometry
