from sprung.fleet.streams.batches import STREAM_SETTINGS as STREAM_SETTINGS
from sprung.fleet.streams.batches import StreamBatch as StreamBatch
from sprung.fleet.streams.batches import StreamSettings as StreamSettings
from sprung.fleet.streams.batches import messages_in_folder as messages_in_folder
from sprung.fleet.streams.batches import messages_in_kafka as messages_in_kafka
from sprung.fleet.streams.batches import stream as stream
from sprung.fleet.streams.batches import windows_of_lake as windows_of_lake
from sprung.fleet.streams.batches import windows_of_messages as windows_of_messages
