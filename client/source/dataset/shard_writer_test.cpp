// Each writer gets batches made here, in different cuts, and its files are read back.
#include "client/source/dataset/shard_writer.h"

#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "client/source/dataset/measurement_csv.h"
#include "client/source/dataset/npy.h"
#include "server/base/files/full_disk.h"
#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

template <typename T>
void AddColumn(v1::Batch* batch, const std::string& name, v1::DataType type, std::vector<uint32_t> shape,
               const std::vector<T>& values) {
  v1::Column* column = batch->add_columns();
  column->set_name(name);
  column->set_type(type);
  column->mutable_shape()->Assign(shape.begin(), shape.end());
  column->set_data(values.data(), values.size() * sizeof(T));
}

// Samples whose numbers tell their index.
Batch MakeBatch(uint64_t start, uint64_t rows, bool encoded_image) {
  v1::Batch batch;
  batch.set_start_index(start);
  batch.set_rows(static_cast<uint32_t>(rows));
  std::vector<uint64_t> index;
  std::vector<int32_t> object;
  std::vector<float> target, approach, lateral, standoff, speed, descriptor;
  std::vector<uint8_t> pixels;
  std::string files;
  std::vector<uint64_t> offsets = {0};
  for (uint64_t i = start; i < start + rows; ++i) {
    index.push_back(i);
    object.push_back(static_cast<int32_t>(i % 2));
    target.insert(target.end(), {0.001f * i, 0, 0});
    approach.insert(approach.end(), {0, 0, -1});
    lateral.insert(lateral.end(), {1, 0, 0});
    standoff.push_back(0.1f);
    speed.push_back(0.02f);
    descriptor.insert(descriptor.end(), {0, 0.001f * i, 0.5f});
    for (int p = 0; p < 4; ++p) pixels.push_back(static_cast<uint8_t>(i + p));
    files += "png of " + std::to_string(i);
    offsets.push_back(files.size());
  }
  AddColumn(&batch, "index", v1::DATA_TYPE_UINT64, {}, index);
  AddColumn(&batch, "object", v1::DATA_TYPE_INT32, {}, object);
  AddColumn(&batch, "target_m", v1::DATA_TYPE_FLOAT32, {3}, target);
  AddColumn(&batch, "approach", v1::DATA_TYPE_FLOAT32, {3}, approach);
  AddColumn(&batch, "lateral", v1::DATA_TYPE_FLOAT32, {3}, lateral);
  AddColumn(&batch, "standoff_m", v1::DATA_TYPE_FLOAT32, {}, standoff);
  AddColumn(&batch, "speed_m_s", v1::DATA_TYPE_FLOAT32, {}, speed);
  AddColumn(&batch, "descriptor_s", v1::DATA_TYPE_FLOAT32, {3}, descriptor);
  if (encoded_image) {
    AddColumn(&batch, "image", v1::DATA_TYPE_BYTES, {}, std::vector<char>(files.begin(), files.end()));
    batch.mutable_columns()->rbegin()->mutable_offsets()->Assign(offsets.begin(), offsets.end());
  } else {
    AddColumn(&batch, "image", v1::DATA_TYPE_UINT8, {2, 2, 1}, pixels);
  }
  return Batch(std::move(batch));
}

class ShardWriterTest : public ::testing::Test {
 protected:
  DatasetLayout Layout(ShardFormat format, const std::string& subfolder) {
    DatasetLayout layout;
    layout.format = format;
    layout.folder = folder_.Path(subfolder);
    fs::create_directories(layout.folder);
    layout.samples = 25;
    layout.shard_size = 10;
    layout.objects = {"lat00", "lat20"};
    const Batch batch = MakeBatch(0, 1, format != ShardFormat::kHdf5);
    for (const v1::Column& column : batch.message().columns()) layout.columns.push_back(FileColumnOf(column));
    return layout;
  }

  // Writes shard 1 (samples 10 .. 19) in batches of the given size.
  FinishedShard Write(const DatasetLayout& layout, uint64_t batch_size) {
    auto writer = CreateShardWriter(layout, 1);
    EXPECT_TRUE(writer.ok()) << writer.status();
    for (uint64_t i = 10; i < 20; i += batch_size) {
      const uint64_t rows = std::min<uint64_t>(batch_size, 20 - i);
      // Rows before and behind those that are written must not get in.
      const Batch batch = MakeBatch(i - 2, rows + 3, layout.format != ShardFormat::kHdf5);
      const absl::Status status = (*writer)->Append(batch, 2, rows);
      EXPECT_TRUE(status.ok()) << status;
    }
    const auto finished = (*writer)->Finish();
    EXPECT_TRUE(finished.ok()) << finished.status();
    return finished.value_or(FinishedShard());
  }

  TestFolder folder_;
};

std::map<std::string, std::string> ReadTar(const std::string& path) {
  std::map<std::string, std::string> members;
  archive* tar = archive_read_new();
  archive_read_support_format_tar(tar);
  EXPECT_EQ(archive_read_open_filename(tar, path.c_str(), 1 << 16), ARCHIVE_OK);
  archive_entry* entry = nullptr;
  while (archive_read_next_header(tar, &entry) == ARCHIVE_OK) {
    std::string data(archive_entry_size(entry), '\0');
    EXPECT_EQ(archive_read_data(tar, data.data(), data.size()), static_cast<la_ssize_t>(data.size()));
    EXPECT_EQ(archive_entry_mtime(entry), 0);
    EXPECT_EQ(archive_entry_uid(entry), 0);
    EXPECT_EQ(archive_entry_perm(entry), 0644u);
    members[archive_entry_pathname(entry)] = data;
  }
  archive_read_free(tar);
  return members;
}

TEST_F(ShardWriterTest, WebDatasetMembersFollowTheConvention) {
  const DatasetLayout layout = Layout(ShardFormat::kWebDataset, "tar");
  const FinishedShard finished = Write(layout, 4);
  EXPECT_EQ(finished.name, "shard-000001.tar");
  EXPECT_EQ(finished.first_index, 10u);
  EXPECT_EQ(finished.samples, 10u);
  const std::string path = layout.folder + "/" + finished.name;
  EXPECT_EQ(finished.bytes, fs::file_size(path));
  EXPECT_EQ(finished.sha256, *Sha256HexOfFile(path));
  const auto members = ReadTar(path);
  EXPECT_EQ(members.size(), 30u);
  EXPECT_EQ(members.at("000013.image.png"), "png of 13");
  EXPECT_EQ(members.at("000013.json"),
            R"({"index":13,"object":"lat20","target_mm":[13,0,0],"approach":[0,0,-1],"lateral":[1,0,0],)"
            R"("standoff_mm":100,"speed_mm_s":20})");
  const std::string& npy = members.at("000013.descriptor_us.npy");
  EXPECT_THAT(npy, StartsWith(std::string("\x93NUMPY\x01\x00", 8)));
  EXPECT_THAT(npy, HasSubstr("{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }"));
  ASSERT_EQ(npy.size(), 128u + 12u - 0u) << "header of two blocks of 64, three floats";
  float values[3];
  std::memcpy(values, npy.data() + npy.size() - 12, 12);
  EXPECT_THAT(values, ElementsAre(0.0f, 13000.0f, 500000.0f));
}

TEST_F(ShardWriterTest, TheCutIntoBatchesChangesNoByte) {
  for (const ShardFormat format : {ShardFormat::kWebDataset, ShardFormat::kFolder, ShardFormat::kHdf5}) {
    const std::string name = ShardFormatName(format);
    const FinishedShard one = Write(Layout(format, name + "1"), 1);
    const FinishedShard all = Write(Layout(format, name + "10"), 10);
    EXPECT_EQ(one.sha256, all.sha256) << name;
    EXPECT_EQ(one.bytes, all.bytes) << name;
  }
}

TEST_F(ShardWriterTest, FactsReadFromDiskAreTheWritersOwn) {
  for (const ShardFormat format : {ShardFormat::kWebDataset, ShardFormat::kFolder, ShardFormat::kHdf5}) {
    const DatasetLayout layout = Layout(format, ShardFormatName(format));
    const FinishedShard written = Write(layout, 3);
    const auto read = ReadFinishedShard(layout, 1);
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->sha256, written.sha256);
    EXPECT_EQ(read->bytes, written.bytes);
  }
}

TEST_F(ShardWriterTest, AFoldersTableIsAMeasurementFile) {
  const DatasetLayout layout = Layout(ShardFormat::kFolder, "folder");
  Write(layout, 7);
  const std::string path = layout.folder + "/shard-000001/";
  const auto touches = session::ParseMeasurements(*ReadFile(path + "touches.csv"), "touches.csv");
  ASSERT_TRUE(touches.ok()) << touches.status();
  ASSERT_EQ(touches->size(), 10u);
  EXPECT_EQ((*touches)[3].touch, 13u);
  EXPECT_EQ((*touches)[3].object, "lat20");
  EXPECT_DOUBLE_EQ((*touches)[3].commanded.target_m().x(), 0.013);
  EXPECT_DOUBLE_EQ((*touches)[3].commanded.speed_m_s(), 0.02);
  EXPECT_DOUBLE_EQ((*touches)[3].time_s[1], 0.013);
  EXPECT_EQ(*ReadFile(path + "000013.png"), "png of 13");
}

TEST_F(ShardWriterTest, Hdf5HoldsColumnsWithUnits) {
  const DatasetLayout layout = Layout(ShardFormat::kHdf5, "hdf5");
  const FinishedShard finished = Write(layout, 3);
  const hid_t file = H5Fopen((layout.folder + "/" + finished.name).c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  ASSERT_GE(file, 0);
  const hid_t dataset = H5Dopen2(file, "descriptor_us", H5P_DEFAULT);
  ASSERT_GE(dataset, 0);
  std::vector<float> values(30);
  ASSERT_GE(H5Dread(dataset, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
  EXPECT_EQ(values[3 * 3 + 1], 13000.0f);
  const hid_t attribute = H5Aopen(dataset, "unit", H5P_DEFAULT);
  char unit[3] = {};
  const hid_t type = H5Aget_type(attribute);
  H5Aread(attribute, type, unit);
  EXPECT_STREQ(unit, "us");
  const hid_t image = H5Dopen2(file, "image", H5P_DEFAULT);
  std::vector<uint8_t> pixels(40);
  ASSERT_GE(H5Dread(image, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, pixels.data()), 0);
  EXPECT_EQ(pixels[4 * 3], 13);
  H5Tclose(type);
  H5Aclose(attribute);
  H5Dclose(image);
  H5Dclose(dataset);
  H5Fclose(file);
}

TEST_F(ShardWriterTest, AnUnfinishedShardLeavesNothing) {
  for (const ShardFormat format : {ShardFormat::kWebDataset, ShardFormat::kFolder, ShardFormat::kHdf5}) {
    const DatasetLayout layout = Layout(format, ShardFormatName(format));
    {
      auto writer = CreateShardWriter(layout, 1);
      ASSERT_TRUE(writer.ok());
      ASSERT_TRUE((*writer)->Append(MakeBatch(10, 4, format != ShardFormat::kHdf5), 0, 4).ok());
      EXPECT_FALSE(fs::is_empty(layout.folder)) << "a .part while it is written";
    }
    EXPECT_TRUE(fs::is_empty(layout.folder)) << ShardFormatName(format);
  }
}

TEST_F(ShardWriterTest, AFullDiskIsTold) {
  for (const ShardFormat format : {ShardFormat::kWebDataset, ShardFormat::kFolder, ShardFormat::kHdf5}) {
    SCOPED_TRACE(ShardFormatName(format));
    const DatasetLayout layout = Layout(format, ShardFormatName(format) + std::string("-full"));
    auto writer = CreateShardWriter(layout, 1);
    ASSERT_TRUE(writer.ok()) << writer.status();
    absl::Status status;
    {
      const FullDisk full;
      status = (*writer)->Append(MakeBatch(10, 10, format != ShardFormat::kHdf5), 0, 10);
      if (status.ok()) status = (*writer)->Finish().status();
    }
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("Make room and run the same command again"));
    writer->reset();
    EXPECT_TRUE(fs::is_empty(layout.folder));
  }
}

TEST_F(ShardWriterTest, NothingIsWrittenThroughALinkThatStandsInTheWay) {
  const DatasetLayout layout = Layout(ShardFormat::kWebDataset, "link");
  const std::string kept = layout.folder + "/of another";
  std::ofstream(kept) << "kept";
  fs::create_symlink(kept, layout.folder + "/shard-000001.tar.part");
  auto writer = CreateShardWriter(layout, 1);
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE((*writer)->Append(MakeBatch(10, 10, true), 0, 10).ok());
  EXPECT_TRUE((*writer)->Finish().ok());
  EXPECT_EQ(ReadFile(kept).value(), "kept");
}

TEST_F(ShardWriterTest, ABatchThatBreaksTheHeadersPromiseIsRefused) {
  const DatasetLayout layout = Layout(ShardFormat::kWebDataset, "broken");
  auto writer = CreateShardWriter(layout, 1);
  v1::Batch batch = MakeBatch(10, 2, true).message();
  batch.mutable_columns(7)->mutable_data()->resize(5);
  const absl::Status status = (*writer)->Append(Batch(batch), 0, 2);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("'descriptor_s' has 5 bytes for 2 samples; 24 were expected"));
}

TEST(Npy, DataBeginsAtAMultipleOf64Bytes) {
  for (uint64_t n = 1; n < 1000000000; n *= 10)
    EXPECT_EQ(NpyHeader(v1::DATA_TYPE_FLOAT32, {n, 3}).size() % 64, 0u);
  EXPECT_THAT(NpyHeader(v1::DATA_TYPE_UINT8, {}), HasSubstr("'shape': (), }"));
}

}  // namespace
}  // namespace touchstone::client
