// touchstone mesh import|supershape|info|correct: mesh files.
#include <filesystem>

#include <absl/strings/ascii.h>

#include "client/cli/options/mesh_options.h"
#include "client/source/dataset/lab_units.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/files/plausible_size.h"
#include "server/geometry/mesh/winding.h"
#include "server/geometry/shapes/supershape.h"
#include "server/model/model.h"
#include "server/touch/touch_notes.h"

namespace touchstone::cli {
namespace {

Json ReportJson(const geometry::TriangleMesh& mesh, const geometry::MeshReport& report) {
  const geometry::Bounds bounds = geometry::ComputeBounds(mesh);
  const auto mm = [](const Eigen::Vector3d& v) {
    return Json{client::LabNumber(Unit::kMillimetre, v.x()), client::LabNumber(Unit::kMillimetre, v.y()),
                client::LabNumber(Unit::kMillimetre, v.z())};
  };
  constexpr double kCubicMillimetresPerCubicMetre =
      1 / (kMetresPerMillimetre * kMetresPerMillimetre * kMetresPerMillimetre);
  return {{"vertices", report.vertices},
          {"triangles", report.triangles},
          {"closed", report.closed()},
          {"bounds_min_mm", mm(bounds.min_m)},
          {"bounds_max_mm", mm(bounds.max_m)},
          {"volume_mm3", report.signed_volume_m3 * kCubicMillimetresPerCubicMetre},
          {"boundary_edges", report.boundary_edges},
          {"nonmanifold_edges", report.nonmanifold_edges},
          {"inconsistent_edges", report.inconsistent_edges},
          {"degenerate_triangles", report.degenerate_triangles},
          {"duplicate_triangles", report.duplicate_triangles},
          {"unused_vertices", report.unused_vertices},
          {"wrongly_wound_triangles", geometry::WronglyWound(mesh).size()},
          {"mesh_hash", geometry::MeshHash(mesh)}};
}

// What is odd about where the object is and how large, a sentence each. `unit` as the coordinates were read.
std::vector<std::string> PlacementNotes(const geometry::TriangleMesh& mesh, const std::string& unit) {
  const geometry::Bounds bounds = geometry::ComputeBounds(mesh);
  std::vector<std::string> notes;
  const std::string size = geometry::SizeNote(bounds, touch::HandSpanM(model::NominalModel()), unit);
  if (!size.empty()) notes.push_back(size);
  if ((bounds.min_m.array() > 0).any() || (bounds.max_m.array() < 0).any())
    notes.push_back(
        "the origin lies outside of its box: a target or a camera's aim at 0,0,0 misses it. touchstone mesh "
        "import --center moves it there");
  return notes;
}

// What the numbers of a report mean for touching.
std::string ReportInWords(const std::string& name, const geometry::TriangleMesh& mesh,
                          const geometry::MeshReport& report, const std::string& unit) {
  const geometry::Bounds bounds = geometry::ComputeBounds(mesh);
  const Eigen::Vector3d size_m = bounds.max_m - bounds.min_m;
  const Eigen::Vector3d centre_m = bounds.Centre();
  const auto mm = [](double metres) { return Rounded(FromSi(Unit::kMillimetre, metres)); };
  std::string text = absl::StrCat(name, ": ", Counted(report.triangles, "triangle", "triangles"), ", ",
                                  Counted(report.vertices, "vertex", "vertices"), "\n");
  absl::StrAppend(&text, "  Size      ", mm(size_m.x()), " x ", mm(size_m.y()), " x ", mm(size_m.z()),
                  " mm, centre at ", mm(centre_m.x()), ", ", mm(centre_m.y()), ", ", mm(centre_m.z()),
                  " mm\n");
  absl::StrAppend(&text, "  Hash      ", geometry::MeshHash(mesh), "\n");
  const size_t wrong = geometry::WronglyWound(mesh).size();
  double volume_m3 = std::abs(report.signed_volume_m3);
  if (wrong > 0 && wrong < mesh.triangles.size()) {
    geometry::TriangleMesh outward = mesh;
    geometry::Turn(geometry::WronglyWound(mesh), &outward);
    volume_m3 = geometry::InspectMesh(outward).signed_volume_m3;
  }
  if (report.closed()) {
    constexpr double kCubicCentimetresPerCubicMetre = 1e6;
    absl::StrAppend(&text, "  Surface   closed, volume ", Rounded(volume_m3 * kCubicCentimetresPerCubicMetre),
                    " cm3\n");
  } else {
    absl::StrAppend(&text, "  Surface   not closed: ");
    if (report.boundary_edges > 0)
      absl::StrAppend(&text, Counted(report.boundary_edges, "open edge", "open edges"),
                      " (a finger may pass through a hole)");
    if (report.nonmanifold_edges > 0)
      absl::StrAppend(&text, report.boundary_edges > 0 ? ", " : "",
                      Counted(report.nonmanifold_edges, "edge", "edges"), " with three triangles or more");
    text += "\n";
  }
  if (wrong == mesh.triangles.size())
    text +=
        "  Note      it is inside out: its triangles run clockwise seen from outside. Touches do not mind. "
        "touchstone mesh "
        "import --outward turns them\n";
  else if (wrong > 0)
    absl::StrAppend(&text, "  Note      ", wrong, " of ", mesh.triangles.size(),
                    " triangles are wound the wrong way round: a "
                    "part of it is inside out; the volume counts them as they should be. touchstone mesh "
                    "import --outward "
                    "turns them\n");
  if (report.inconsistent_edges > 0)
    absl::StrAppend(&text, "  Note      ", Counted(report.inconsistent_edges, "edge is", "edges are"),
                    " run through twice in the same direction: neighbouring triangles face opposite ways\n");
  if (report.degenerate_triangles > 0 || report.duplicate_triangles > 0)
    absl::StrAppend(&text, "  Note      ", Counted(report.degenerate_triangles, "triangle", "triangles"),
                    " without area and ", report.duplicate_triangles,
                    " repeated: they are left out when the object is touched\n");
  if (report.unused_vertices > 0)
    absl::StrAppend(&text, "  Note      ",
                    Counted(report.unused_vertices, "vertex belongs", "vertices belong"),
                    " to no triangle\n");
  for (const std::string& note : PlacementNotes(mesh, unit))
    absl::StrAppend(&text, "  Note      ", note, "\n");
  return text;
}

// `unit` as the coordinates of the mesh's file were read.
void Report(const Cli& cli, const std::string& name, const geometry::TriangleMesh& mesh,
            const std::string& unit) {
  const geometry::MeshReport report = geometry::InspectMesh(mesh);
  if (cli.output().json) {
    Json json = ReportJson(mesh, report);
    json["notes"] = PlacementNotes(mesh, unit);
    PrintJson(json);
  } else if (!cli.output().quiet) {
    cli.Print(ReportInWords(name, mesh, report, unit)).IgnoreError();
  }
}

}  // namespace

absl::StatusOr<geometry::TriangleMesh> ReadMesh(const Cli& cli, const MeshOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--unit", options.unit, geometry::MeshUnitNames()).status());
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--up", options.up, geometry::MeshUpAxisNames()).status());
  geometry::MeshImport import;
  import.unit = options.unit;
  import.up = options.up;
  import.scale = options.scale;
  if (options.fit_mm != 0) import.fit_mm = options.fit_mm;
  std::vector<std::string> notes;
  TOUCHSTONE_ASSIGN_OR_RETURN(geometry::TriangleMesh mesh,
                              geometry::ReadMeshFile(options.input, import, &notes));
  for (const std::string& note : notes) cli.Log("note: " + note);
  return mesh;
}

absl::Status WriteMesh(const Cli& cli, const MeshOptions& options, const geometry::TriangleMesh& mesh) {
  // The ending names the format; standard output gets OFF.
  const std::string extension = std::filesystem::path(options.output).extension().string();
  const std::string format = IsStandardOutput(options.output) ? "off"
                             : extension.empty()              ? ""
                                                              : absl::AsciiStrToLower(extension.substr(1));
  const absl::StatusOr<std::string> text = geometry::MeshFileText(mesh, format);
  if (!text.ok())
    return absl::Status(text.status().code(),
                        absl::StrCat("-o: ", options.output, ": ", text.status().message()));
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, *text));
  Report(cli, IsStandardOutput(options.output) ? "mesh" : options.output, mesh, options.unit);
  return absl::OkStatus();
}

namespace {

// Moves the mesh so that the centre of its bounding box is the origin, and says by how much.
void Center(const Cli& cli, geometry::TriangleMesh* mesh) {
  const Eigen::Vector3d centre_m = geometry::ComputeBounds(*mesh).Centre();
  for (Eigen::Vector3f& vertex_m : mesh->vertices_m)
    vertex_m = (vertex_m.cast<double>() - centre_m).cast<float>();
  const auto mm = [&](int axis) { return Rounded(FromSi(Unit::kMillimetre, 0.0 - centre_m[axis])); };
  cli.Log(absl::StrCat("moved every vertex by ", mm(0), ", ", mm(1), ", ", mm(2),
                       " mm: the centre of the bounding box is the origin now"));
}

absl::Status RunImport(const Cli& cli, const MeshOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(geometry::TriangleMesh mesh, ReadMesh(cli, options));
  if (options.outward) {
    const std::vector<uint32_t> wrong = geometry::WronglyWound(mesh);
    geometry::Turn(wrong, &mesh);
    cli.Log(absl::StrCat("turned ", Counted(wrong.size(), "triangle", "triangles"), " outward"));
  }
  if (options.center) Center(cli, &mesh);
  return WriteMesh(cli, options, mesh);
}

absl::Status RunInfo(const Cli& cli, const MeshOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::TriangleMesh mesh, ReadMesh(cli, options));
  Report(cli, options.input, mesh, options.unit);
  return absl::OkStatus();
}

// "4,10,15,10" or "4,10,15,10,1,1": m, n1, n2, n3 and, if other than 1, a and b.
absl::StatusOr<geometry::Superformula> ParseSuperformula(const std::string& name, const std::string& text) {
  std::vector<double> values;
  for (const std::string& part : SplitCommas({text})) {
    const absl::StatusOr<double> value = ParseNumber(part);
    if (!value.ok()) return absl::InvalidArgumentError(absl::StrCat(name, ": ", value.status().message()));
    values.push_back(*value);
  }
  if (values.size() != 4 && values.size() != 6)
    return absl::InvalidArgumentError(absl::StrCat(name, ": '", text, "' has ", values.size(),
                                                   " numbers; m,n1,n2,n3 or m,n1,n2,n3,a,b was expected"));
  geometry::Superformula formula;
  formula.m = values[0];
  formula.n1 = values[1];
  formula.n2 = values[2];
  formula.n3 = values[3];
  if (values.size() == 6) formula.a = values[4], formula.b = values[5];
  return formula;
}

absl::Status RunSupershape(const Cli& cli, const MeshOptions& options) {
  geometry::SupershapeParameters parameters;
  if (!options.name.empty()) {
    if (!options.longitude.empty() || !options.latitude.empty())
      return absl::InvalidArgumentError(
          "--longitude and --latitude make a shape of your own; leave NAME out");
    TOUCHSTONE_ASSIGN_OR_RETURN(parameters, geometry::NamedSupershape(options.name));
  } else if (options.longitude.empty() || options.latitude.empty()) {
    return absl::InvalidArgumentError(
        "which shape? Give NAME (lat00, lat05, lat10, lat15, lat20), or --longitude and --latitude");
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(parameters.longitude, ParseSuperformula("--longitude", options.longitude));
    TOUCHSTONE_ASSIGN_OR_RETURN(parameters.latitude, ParseSuperformula("--latitude", options.latitude));
  }
  if (options.width_mm) parameters.width_m = ToSi(Unit::kMillimetre, *options.width_mm);
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::TriangleMesh mesh,
                              geometry::MakeSupershape(parameters, options.triangles));
  return WriteMesh(cli, options, mesh);
}

}  // namespace

void AddImportOptions(CLI::App* command, MeshOptions* options) {
  const auto add = [&](const std::string& name, auto& value, const std::string& type,
                       const std::string& text) { command->add_option(name, value, text)->type_name(type); };
  add("--unit", options->unit, "UNIT", "Of the file's coordinates: mm, cm, m or inch. Default: mm");
  add("--up", options->up, "AXIS", "The file's axis that points up: x, y or z. Default: z");
  add("--scale", options->scale, "FACTOR", "A further factor. Default: 1");
  add("--fit-mm", options->fit_mm, "MM",
      "Instead of unit and scale: make the longest side of the box this long");
}

void AddMesh(Cli* cli) {
  auto options = std::make_shared<MeshOptions>();
  CLI::App* group =
      cli->AddGroup("mesh", "Converts, makes and inspects mesh files.",
                    "touchstone mesh info cup.stl --unit inch\n"
                    "touchstone mesh import cup.stl --unit inch --up y -o cup.off\n"
                    "touchstone mesh supershape lat20 --triangles 100000 -o lat20.obj\n"
                    "touchstone mesh correct cup.off --map better.surface.csv -o cup_measured.off");
  const auto add_output = [&](CLI::App* command) {
    cli->AddOutput(command, "-o,--output", &options->output,
                   "The file to write, .off or .obj; -: stdout, OFF")
        ->required();
  };

  CLI::App* import =
      cli->AddCommand(group, "import", "Converts a mesh (OFF, OBJ, STL, PLY) to millimetres, z up.",
                      "touchstone mesh import cup.stl --unit inch --up y -o cup.off\n"
                      "touchstone mesh import scan.ply --fit-mm 150 --center -o scan.obj",
                      [cli, options] { return RunImport(*cli, *options); });
  cli->AddInput(import,
                import->add_option("FILE", options->input, "The mesh to read")->type_name("")->required());
  add_output(import);
  AddImportOptions(import, options.get());
  import->add_flag("--outward", options->outward,
                   "Turn the triangles of closed parts that run clockwise seen from outside");
  import->add_flag(
      "--center", options->center,
      "Move the mesh so that the centre of its bounding box is the origin, about which object_scale and "
      "object_pose scale and turn it");

  CLI::App* shape = cli->AddCommand(
      group, "supershape", "Writes a Gielis supershape: one of the five built-in ones, or one of your own.",
      "touchstone mesh supershape lat20 --triangles 100000 -o lat20.obj\n"
      "touchstone mesh supershape --longitude 6,10,10,10 --latitude 4,10,20,10 --width-mm 120 -o star.off",
      [cli, options] { return RunSupershape(*cli, *options); });
  shape->add_option("NAME", options->name, "lat00, lat05, lat10, lat15 or lat20")->type_name("");
  shape->add_option("--triangles", options->triangles, "About so many, 48 to 4000000. Default: 20000")
      ->type_name("N");
  shape
      ->add_option("--longitude", options->longitude,
                   "The formula round the z axis; a and b are 1 if left out")
      ->type_name("M,N1,N2,N3[,A,B]");
  shape->add_option("--latitude", options->latitude, "The formula from pole to pole")
      ->type_name("M,N1,N2,N3[,A,B]");
  shape->add_option("--width-mm", options->width_mm, "The larger extent along x and y. Default: 150")
      ->type_name("MM");
  add_output(shape);

  CLI::App* info = cli->AddCommand(group, "info", "Says what a mesh is like: size, holes, faults.",
                                   "touchstone mesh info cup.stl --unit inch\n"
                                   "touchstone mesh info scan.ply --json",
                                   [cli, options] { return RunInfo(*cli, *options); });
  info->add_option("FILE", options->input, "The mesh to read")->type_name("")->required();
  AddImportOptions(info, options.get());

  CLI::App* correct =
      cli->AddCommand(group, "correct",
                      "Writes a mesh as it was measured: its surface moved along the normals by a surface "
                      "map, refined so far that "
                      "the map's bumps show.",
                      "touchstone mesh correct lat00.off --map better.surface.csv -o lat00_measured.off\n"
                      "touchstone mesh correct scan.ply --map better.surface.csv --object cup -o cup.off",
                      [cli, options] { return RunMeshCorrect(*cli, *options); });
  cli->AddInput(
      correct, correct->add_option("MESH", options->input, "The mesh to correct")->type_name("")->required());
  cli->AddInput(correct, correct
                             ->add_option("--map", options->map,
                                          "The surface map that touchstone diagnose --with-surface-map wrote")
                             ->type_name("FILE")
                             ->required());
  correct
      ->add_option("--object", options->object,
                   "Which object of the map the mesh is. Default: the mesh file's name without its ending")
      ->type_name("NAME");
  add_output(correct);
  AddImportOptions(correct, options.get());
}

}  // namespace touchstone::cli
