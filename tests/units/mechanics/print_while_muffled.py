"""Count aloud to 20 000 while other threads muffle and unmuffle theirs."""

import threading

from tolcontact.mechanics.quiet import quiet

done = threading.Event()


def muffle():
    while not done.is_set():
        with quiet():
            pass


workers = [threading.Thread(target=muffle) for _ in range(2)]
for worker in workers:
    worker.start()
for number in range(20_000):
    print(number, flush=True)
done.set()
