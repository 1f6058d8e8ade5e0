#include "server/base/threads/fair_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace touchstone {
namespace {

// The tasks write their names down.
class FairQueueTest : public testing::Test {
 protected:
  void Add(const std::string& client, uint64_t stream, const std::string& name) {
    queue_.Add(client, stream, {[this, name] { ran_ += name; }});
  }
  // Whose turn it is; the task takes so long.
  void RunNext(double took_s) {
    const FairQueue::Begun begun = *queue_.Begin();
    begun.task.run();
    queue_.Charge(begun.stream, took_s);
    queue_.End(begun.stream);
  }

  FairQueue queue_;
  std::string ran_;
};

TEST_F(FairQueueTest, KeepsTheOrderWithinAStream) {
  for (const char* name : {"a", "b", "c"}) Add("x", 1, name);
  for (int k = 0; k < 3; ++k) RunNext(1);
  EXPECT_EQ(ran_, "abc");
  EXPECT_EQ(queue_.waiting(), 0u);
  EXPECT_FALSE(queue_.Begin().has_value());
}

TEST_F(FairQueueTest, ClientsHaveTurnsByTimeHoweverManyStreamsTheyHave) {
  for (uint64_t stream = 1; stream <= 8; ++stream) Add("x", stream, "x");
  for (int k = 0; k < 4; ++k) Add("y", 9, "y");
  for (int k = 0; k < 8; ++k) RunNext(1);
  EXPECT_EQ(ran_, "xyxyxyxy");
}

TEST_F(FairQueueTest, StreamsOfAClientHaveTurnsByTime) {
  for (int k = 0; k < 4; ++k) Add("x", 1, "1");
  for (int k = 0; k < 4; ++k) Add("x", 2, "2");
  RunNext(3);  // of stream 1
  for (int k = 0; k < 5; ++k) RunNext(1);
  EXPECT_EQ(ran_, "122212") << "after 3 s of stream 1 it is the turn of 2 until it has had as much";
}

TEST_F(FairQueueTest, NobodySavesUpTimeByIdling) {
  Add("x", 1, "x");
  Add("y", 2, "y");
  RunNext(1), RunNext(1);
  for (int k = 0; k < 10; ++k) Add("x", 1, "x"), RunNext(1);  // y asks for nothing meanwhile
  ran_.clear();
  for (int k = 0; k < 6; ++k) Add("x", 1, "x"), Add("y", 2, "y");
  for (int k = 0; k < 6; ++k) RunNext(1);
  EXPECT_EQ(std::count(ran_.begin(), ran_.end(), 'x'), 3) << ran_;
}

TEST_F(FairQueueTest, ThreadsThatLookAtOnceFindSeveralClients) {
  for (int k = 0; k < 2; ++k) Add("x", 1, "x"), Add("y", 2, "y");
  const FairQueue::Begun first = *queue_.Begin(), second = *queue_.Begin();
  EXPECT_NE(first.stream->client, second.stream->client);
}

TEST_F(FairQueueTest, WhoStopsInTheMiddleGoesOnBeforeItsOtherTasks) {
  Add("x", 1, "a"), Add("x", 1, "c");
  Add("y", 2, "y");
  FairQueue::Begun begun = *queue_.Begin();
  begun.task.run();
  EXPECT_FALSE(queue_.OthersAreNext(*begun.stream)) << "nothing is known to have been taken";
  queue_.Charge(begun.stream, 1);
  EXPECT_TRUE(queue_.OthersAreNext(*begun.stream));
  queue_.GoOnLater(begun.stream, {[this] { ran_ += "b"; }, true});
  for (int k = 0; k < 3; ++k) RunNext(2);
  EXPECT_EQ(ran_, "aybc");
}

// Also while another client, which has used a little less, runs and waits too.
TEST_F(FairQueueTest, AStreamGivesWayToOthersOfItsClientBesideABusyClient) {
  for (uint64_t stream = 1; stream <= 3; ++stream) Add("x", stream, "x");
  for (int k = 0; k < 2; ++k) Add("y", 9, "y");
  const FairQueue::Begun x = *queue_.Begin(), y = *queue_.Begin();
  ASSERT_NE(x.stream->client, y.stream->client);
  queue_.Charge(y.stream, 0.0200);
  queue_.Charge(x.stream, 0.0201);
  EXPECT_TRUE(queue_.OthersAreNext(*x.stream)) << "two streams of x have had nothing";
  EXPECT_FALSE(queue_.OthersAreNext(*y.stream));
}

TEST_F(FairQueueTest, AloneNobodyGivesWay) {
  Add("x", 1, "a"), Add("x", 1, "b");
  const FairQueue::Begun begun = *queue_.Begin();
  queue_.Charge(begun.stream, 100);
  EXPECT_FALSE(queue_.OthersAreNext(*begun.stream)) << "its own next task is no other's";
}

}  // namespace
}  // namespace touchstone
